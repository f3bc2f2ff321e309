# SPDX-License-Identifier: Apache-2.0
"""Options for the robot and the world.

They are for verbs (first arguments of the command `mobee`) that need no running system.
"""

from __future__ import annotations

import argparse
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from mobee.model.world import World
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import Corners
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT
from services.common.worlds import NO_WORLD, is_path, world_around


def add_urdf_options(parser: argparse.ArgumentParser) -> None:
    """Add options for the keywords of `mobee.load_robot` to a parser: --field, --meshes, --corners, --srdf and --home."""
    parser.add_argument("--field", type=float, metavar="M", help="give every solid of a URDF a field that is larger by M [m]")
    parser.add_argument("--meshes", choices=("hull", "bounding"), help="read meshes of a URDF as convex hulls or as bounding primitives")
    parser.add_argument(
        "--corners", type=_corners, metavar="N", help="largest number of corners of a hull (default: 64), or all: the exact hull"
    )
    parser.add_argument("--srdf", type=Path, metavar="FILE", help="SRDF of a URDF, if it is not found by its name")
    parser.add_argument("--home", metavar="NAME", help="<group_state> of the SRDF that is the home posture, or zero")


def urdf_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """Return the options for URDF files as keywords of `mobee.load_robot`, by name; None for an option that is not given."""
    return {name: getattr(arguments, name) for name in ("field", "meshes", "corners", "srdf", "home")}


def _corners(text: str) -> Corners:
    if text == "all":
        return "all"
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is neither a whole number nor 'all'")
    return int(text)


DEFAULT = "icub"
_RUN_SETTINGS = "scenario.toml"  # in the folder of a run of `mobee launch`


def add_robot(parser: argparse.ArgumentParser, text: str) -> None:
    """Add the option --robot, and options for URDF files, to a parser. `text`: default of --robot, for the help."""
    parser.add_argument("--robot", metavar="FILE", help=f"shipped robot, or path of a .xml or .urdf file ({text})")
    add_urdf_options(parser)


def add_world(parser: argparse.ArgumentParser) -> None:
    """Add the option --world to a parser."""
    text = f"shipped world, path of a .xml file, or {NO_WORLD} (default: the table for the shipped iCubs, {NO_WORLD} for other robots)"
    parser.add_argument("--world", metavar="FILE", help=text)


def add_cameras(parser: argparse.ArgumentParser) -> None:
    """Add the option --camera, for cameras on links, to a parser."""
    text = "a camera on a link or marker, as hand or hand=0,0,0.1,0,0,1: a place [m] and a direction of view in its frame; may be repeated"
    parser.add_argument("--camera", dest="cameras", action="append", default=[], metavar="LINK", help=text)


def robot_given(arguments: argparse.Namespace, default: str = DEFAULT) -> Robot:
    """Load the robot that the arguments name, or the default robot. Raises MobeeError if it cannot be read."""
    return load_robot(arguments.robot or default, **urdf_options(arguments))


def world_given(arguments: argparse.Namespace, default: str = DEFAULT) -> World:
    """Load the world that the arguments name; without a name, the usual world of the robot.

    `default`: robot if the arguments name none. Raises MobeeError if the world or the robot cannot be read.
    """
    return world_around(arguments.world, arguments.robot or default)


def robot_of_run(run: Path) -> str | None:
    """Return the name or path of the robot in the settings of a run; None if the run has no settings, or they name no robot.

    `run`: folder of a run of `mobee launch`, or a file in it. Raises UserError if the settings cannot be read, or their robot file does not
    exist.
    """
    file = (run if run.is_dir() else run.parent) / _RUN_SETTINGS
    try:
        services = tomllib.loads(file.read_text()).get("services")
    except FileNotFoundError:
        return None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError, RecursionError) as error:
        raise UserError(f"{file}: the settings of the run cannot be read ({error}): name its robot with --robot FILE", BAD_INPUT) from None
    tables = services.values() if isinstance(services, dict) else ()
    named = [table["robot"] for table in tables if isinstance(table, dict) and isinstance(table.get("robot"), str)]
    if named and is_path(named[0]) and not Path(named[0]).is_file():
        raise UserError(
            f"{named[0]}: the settings of the run name this robot file, but it does not exist: name it with --robot FILE",
            BAD_INPUT,
        )
    return named[0] if named else None


def given_options(arguments: argparse.Namespace, names: Sequence[str] = ("robot", "world")) -> list[str]:
    """Return the options for robot, world and URDF files that the user has given, each as one string, such as "--robot icub".

    `names`: which of the options --robot and --world to include, if they are given.
    """
    options = {name: getattr(arguments, name, None) for name in names} | urdf_options(arguments)
    return [f"--{name} {value}" for name, value in options.items() if value is not None]


def require_none(arguments: argparse.Namespace, why: str, names: Sequence[str] = ("robot", "world")) -> None:
    """Raise UserError if the user has given an option for the robot, the world or URDF files, because this command cannot use it.

    `why`: why the command cannot use it. The error contains the first such option, then this text. `names`: which of the options --robot
    and --world to refuse; options for URDF files are always refused.
    """
    for option in given_options(arguments, names):
        raise UserError(f"{option}: {why}", BAD_INPUT)
