# SPDX-License-Identifier: Apache-2.0
"""`mobee convert`: converts robot files from zero-position XML to URDF and back.

A zero-position XML describes a robot in the pose in which every joint is at zero, with all axes in the root frame. Robot and world files
in older versions of this format are converted to the present one.
"""

from __future__ import annotations

import argparse
import warnings
from pathlib import Path

from mobee.check.run import world_file
from mobee.errors import MobeeError
from mobee.model.world import World
from mobee.model.world_file import load_world
from mobee.robot.load import ROBOTS, find_file, load_robot
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.robot import Robot
from mobee.robot.urdf.write import write_urdf
from mobee.robot.xml.node import Remark
from mobee.robot.xml.write import write_upgraded, write_xml
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_urdf_options, require_none, urdf_options
from services.common.exit_codes import BAD_INPUT, FAILED

WRITERS = {".xml": write_xml, ".urdf": write_urdf}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee convert` to the parser: input file, output file and options for URDF files."""
    parser.add_argument("source", metavar="IN", help="shipped robot, or a .xml, .urdf or MJCF file, or a world in .xml")
    parser.add_argument("target", metavar="OUT", type=Path, help=".xml or .urdf file to write")
    add_urdf_options(parser)
    parser.add_argument("--force", action="store_true", help="overwrite existing files")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee convert`: write the converted file, print its content and what the new format cannot express; return the exit code."""
    target: Path = arguments.target
    if target.suffix.lower() not in WRITERS:
        raise UserError(f"{target}: OUT must end in .xml or .urdf", BAD_INPUT)
    if not target.resolve().parent.is_dir():
        raise UserError(f"{target}: there is no folder {target.resolve().parent}: create it", BAD_INPUT)
    taken = [path for path in _written(target) if path.exists()]
    if taken and not arguments.force:
        raise UserError(f"{taken[0]} exists already. Choose another name, or overwrite it with --force", BAD_INPUT)
    try:
        lines = _convert(arguments, target)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from error
    except OSError as error:
        raise UserError(f"{error.filename or target} cannot be written ({error.strerror})", FAILED) from error
    print("\n".join(lines))
    return 0


def _convert(arguments: argparse.Namespace, target: Path) -> list[str]:
    """Write the target, and return a description of its content."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        world = world_file(arguments.source)
        if world is not None:
            require_none(arguments, f"{world} is a world, and this option is for robots in URDF and MJCF: leave it out", ())
        content = load_robot(arguments.source, **urdf_options(arguments)) if world is None else load_world(world)
    if isinstance(content, World):
        if world is None or target.suffix.lower() != ".xml":
            raise UserError(f"{target}: a world can only be written as .xml: a URDF holds robots only", BAD_INPUT)
        return [f"{target}: {len(content.objects)} objects", *_understood(write_upgraded(world, target) or [])]
    source = find_file(arguments.source, ROBOTS, "robot")
    if source.suffix.lower() == target.suffix.lower() == ".xml" and not is_mjcf(source):
        remarks = write_upgraded(source, target)
        if remarks is not None:
            return [_summary(content, target), *_understood(remarks)]
    WRITERS[target.suffix.lower()](content, target)
    return [*(str(warning.message) for warning in caught), _summary(content, target)]


def _understood(remarks: list[Remark]) -> list[str]:
    """Return how an older file was interpreted, a line for each remark."""
    return [f"{remark.node.file}:{remark.node.line}: {remark.what}" for remark in remarks]


def _written(target: Path) -> tuple[Path, ...]:
    return (target, target.with_suffix(".srdf")) if target.suffix.lower() == ".urdf" else (target,)


def _summary(robot: Robot, target: Path) -> str:
    counts = f"{len(robot.motors)} motors, {len(robot.joints)} joints, {len(robot.shapes)} shapes, {len(robot.markers)} markers"
    lines = [f"{target}: {robot.name}, {counts}"]
    if target.suffix.lower() == ".urdf":
        lines.append(f"{target.with_suffix('.srdf')}: parts as groups, home, pairs that are not tested")
        if robot.clauses:
            lines.append(f"{len(robot.clauses)} clauses are written as a comment only: URDF cannot express them")
    return "\n".join(lines)
