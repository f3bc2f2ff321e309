"""`mobee convert IN OUT`: zero-position XML to URDF, URDF to zero-position XML, by the endings of the two files."""

from __future__ import annotations

import argparse
from pathlib import Path

from mobee.errors import MobeeError
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.write_urdf import write_urdf
from mobee.robot.write_xml import write_xml
from mobee_cli.errors import BAD_INPUT, FAILED, UserError
from mobee_cli.urdf_options import add_urdf_options, urdf_options

WRITERS = {".xml": write_xml, ".urdf": write_urdf}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The two files and how a URDF is read."""
    parser.add_argument("source", metavar="IN", help="a shipped robot, or a .xml or .urdf file")
    parser.add_argument("target", metavar="OUT", type=Path, help="the .xml or .urdf file to write")
    add_urdf_options(parser)
    parser.add_argument("--force", action="store_true", help="write over files that are there")


def run(arguments: argparse.Namespace) -> int:
    """Read, write, and say what came out and what the new file cannot hold."""
    target: Path = arguments.target
    if target.suffix.lower() not in WRITERS:
        raise UserError(f"{target}: OUT must end in .xml or .urdf", BAD_INPUT)
    if not target.resolve().parent.is_dir():
        raise UserError(f"{target}: there is no folder {target.resolve().parent}: make it, or choose another", FAILED)
    taken = [path for path in _written(target) if path.exists()]
    if taken and not arguments.force:
        raise UserError(f"{taken[0]} is there already. Choose another name, or write over it with --force", BAD_INPUT)
    try:
        robot = load_robot(arguments.source, **urdf_options(arguments))
        WRITERS[target.suffix.lower()](robot, target)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from error
    except OSError as error:
        raise UserError(f"{error.filename or target} cannot be written ({error.strerror})", FAILED) from error
    print(_summary(robot, target))
    return 0


def _written(target: Path) -> tuple[Path, ...]:
    return (target, target.with_suffix(".srdf")) if target.suffix.lower() == ".urdf" else (target,)


def _summary(robot: Robot, target: Path) -> str:
    counts = f"{len(robot.motors)} motors, {len(robot.joints)} joints, {len(robot.shapes)} shapes, {len(robot.markers)} markers"
    lines = [f"{target}: {robot.name}, {counts}"]
    if target.suffix.lower() == ".urdf":
        lines.append(f"{target.with_suffix('.srdf')}: parts as groups, home, pairs that are not tested")
        if robot.clauses:
            lines.append(f"{len(robot.clauses)} clauses stand in a comment only: URDF cannot express them")
    return "\n".join(lines)
