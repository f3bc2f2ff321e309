# SPDX-License-Identifier: Apache-2.0
"""`mobee view`: shows the robot of a file in motion."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mobee.errors import MobeeError
from mobee.model.world import World
from mobee.model.world_file import shipped_worlds
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_urdf_options, urdf_options
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT
from services.common.worlds import world_around

_NOTES = """Each motor moves through its range, then all motors together. Shapes in contact
are red, and arrows show the direction that separates them. The verb prints the
address of a page, and ends with Ctrl-C; with --save it writes a file instead,
for `rerun FILE`."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee view` to the parser: the file and others."""
    parser.epilog = _NOTES
    parser.add_argument("file", help="shipped robot, or path of a .xml or .urdf file")
    parser.add_argument("--world", metavar="FILE", help="shipped world, or path of a .xml file, to show around it")
    add_urdf_options(parser)
    parser.add_argument("--solids", action="store_true", help="show the solids instead of what the file draws")
    parser.add_argument("--save", type=Path, metavar="FILE.rrd", help="write a recording and end")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee view`: load the robot, show it in motion, and return the exit code."""
    save: Path | None = arguments.save
    require_recording(save)
    try:
        robot = load_robot(arguments.file, **urdf_options(arguments))
        world = world_around(arguments.world, arguments.file) if arguments.world else None
    except MobeeError as error:
        hint = f" It is a world: `mobee view icub --world {arguments.file}`." if arguments.file in shipped_worlds() else ""
        raise UserError(f"{error}{hint}", BAD_INPUT) from None
    return show(robot, world, save, solids=arguments.solids)


def require_recording(save: Path | None) -> None:
    """Raise UserError if a recording cannot be written to the path `save`: its name must end in .rrd, and its folder must exist.

    None is valid.
    """
    if save is None:
        return
    if save.suffix.lower() != ".rrd":
        raise UserError(f"--save {save}: recordings must have a name that ends in .rrd", BAD_INPUT)
    require_writable("--save", save)


def require_writable(option: str, path: Path) -> None:
    """Raise UserError if a file cannot be written to the path that an option has; the folder of the file must exist.

    No file is made or changed.
    """
    if not path.resolve().parent.is_dir():
        raise UserError(f"{option} {path}: there is no folder {path.resolve().parent}: create it", BAD_INPUT)
    existed = path.exists()
    try:
        with path.open("ab"):
            pass
    except OSError as error:
        raise UserError(f"{option} {path}: cannot be written ({error.strerror}): give another file", BAD_INPUT) from None
    if not existed:
        path.unlink()


def show(robot: Robot, world: World | None, save: Path | None, stretches: Sequence[Any] | None = None, solids: bool = False) -> int:
    """Show the robot in motion on a page until Ctrl-C, or save the motion to a file; return the exit code.

    `world`: objects around the robot. `save`: file to write; None: show a page. `stretches`: sections of the motion, each a
    `services.monitor.viewer.view.Stretch`; None: all motors move through their ranges. `solids`: show the solids (volumes by which contacts
    are found) instead of the visuals (surfaces in the robot file).
    """
    try:
        from services.monitor.viewer.view import view  # needs the viewer, which is an extra
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rerun":
            raise
        raise UserError('a view needs rerun-sdk: pip install "mobee[viz]"', ENVIRONMENT) from None
    try:
        view(robot, world, save, lambda address: print(f"{robot.name} at {address}\nCtrl-C ends it.", flush=True), stretches, solids)
    except KeyboardInterrupt:
        if save is not None:
            raise
        return 0
    if save is None:
        raise UserError("the server of the page has ended unexpectedly; --save FILE.rrd writes a recording instead")
    print(f"{save}: open it with `rerun {save}`")
    return 0
