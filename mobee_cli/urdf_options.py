"""Options of a robot that comes from a URDF, for every verb that reads one."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any


def add_urdf_options(parser: argparse.ArgumentParser) -> None:
    """The keywords of load_robot."""
    parser.add_argument("--field", type=float, metavar="M", help="give every solid of a URDF a field that reaches so much farther [m]")
    parser.add_argument("--meshes", choices=("hull", "bounding"), help="meshes of a URDF: convex hulls, or bounding primitives")
    parser.add_argument("--srdf", type=Path, metavar="FILE", help="the SRDF of a URDF, when it does not lie beside it")


def urdf_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """The keywords of load_robot that were given."""
    return {"field": arguments.field, "meshes": arguments.meshes, "srdf": arguments.srdf}
