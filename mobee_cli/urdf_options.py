"""Options of a robot that comes from a URDF, for every verb that reads one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from mobee.robot.urdf.hull import Corners


def add_urdf_options(parser: argparse.ArgumentParser) -> None:
    """The keywords of load_robot."""
    parser.add_argument("--field", type=float, metavar="M", help="give every solid of a URDF a field that reaches so much farther [m]")
    parser.add_argument("--meshes", choices=("hull", "bounding"), help="meshes of a URDF: convex hulls, or bounding primitives")
    parser.add_argument(
        "--corners", type=_corners, metavar="N", help="corners of such a hull at most (default: 64), or all: the exact hull"
    )
    parser.add_argument("--srdf", type=Path, metavar="FILE", help="the SRDF of a URDF, when it is not found by its name")
    parser.add_argument("--home", metavar="NAME", help="the <group_state> of the SRDF that is home, or zero")


def urdf_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The keywords of load_robot that were given."""
    return {name: getattr(arguments, name) for name in ("field", "meshes", "corners", "srdf", "home")}


def _corners(text: str) -> Corners:
    if text == "all":
        return "all"
    if not (text.isascii() and text.isdecimal()):
        raise argparse.ArgumentTypeError(f"{text!r} is neither a whole number nor 'all'")
    return int(text)
