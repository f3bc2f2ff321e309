# SPDX-License-Identifier: Apache-2.0
"""Finds shipped robots by name, and reads any robot file by path."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from mobee.errors import InvalidValue, RobotFileError, UnknownName
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.mjcf.menagerie import menagerie_file, menagerie_names
from mobee.robot.robot import Robot
from mobee.robot.xml.file import is_file
from mobee.robot.xml.read import read_robot

if TYPE_CHECKING:
    from mobee.robot.urdf.hull import Corners
    from mobee.robot.urdf.shapes import Meshes

ROBOTS = Path(__file__).parent / "robots"


def load_robot(
    name_or_path: str | Path,
    *,
    field: float | None = None,
    meshes: Meshes | None = None,
    corners: Corners | None = None,
    srdf: str | Path | None = None,
    home: str | None = None,
) -> Robot:
    """Load a shipped robot by name (see `shipped_robots`), or the robot of a zero-position .xml, a .urdf or an MJCF file.

    Args:
        name_or_path: a shipped name, the path of a file, or with the package mujoco-menagerie a name of MuJoCo Menagerie.
        field: URDF and MJCF: distance [m] by which fields extend beyond the solids, one field for every solid; None: no fields.
        meshes: URDF and MJCF: "hull" (the default) or "bounding", see `UrdfOptions`.
        corners: URDF and MJCF: the largest number of corners of a mesh's hull (64 by default), or "all" for the exact hull.
        srdf: URDF only: the SRDF file; None: one beside the URDF or in ../srdf, if there is any, see docs/robots.md.
        home: the name of a <group_state> of the SRDF or of a keyframe of the MJCF, or "zero"; None: see docs/robots.md.

    Raises:
        UnknownName: with the nearest shipped name.
        InvalidValue: for an option that is not valid for the file.
        RobotFileError: with file, line, field and remedy.
        NotInstalled: an MJCF file without the package mujoco.
    """
    path = find_file(name_or_path, ROBOTS, "robot")
    is_urdf = path.suffix.lower() == ".urdf"
    if is_urdf or is_mjcf(path):
        from mobee.robot.mjcf.read import read_mjcf  # fourteen modules, and no shipped robot needs them
        from mobee.robot.urdf.hull import CORNERS
        from mobee.robot.urdf.read import UrdfOptions, read_urdf

        reader = read_urdf if is_urdf else read_mjcf
        return reader(path, UrdfOptions(field, meshes or "hull", CORNERS if corners is None else corners, srdf, home))
    options = {"field": field, "meshes": meshes, "corners": corners, "srdf": srdf, "home": home}
    given = [name for name, value in options.items() if value is not None]
    if given:
        raise InvalidValue(
            f"{given[0]}= is for URDF and MJCF files only, and {path} is none: zero-position XML has tags for it. Leave it out."
        )
    return read_robot(path)


def shipped_robots() -> tuple[str, ...]:
    """Return the names of the robots that come with this library, sorted."""
    return shipped(ROBOTS)


def find_file(name_or_path: str | Path, folder: Path, kind: str) -> Path:
    """Return the file of a shipped name or a path; raises InvalidValue, UnknownName or RobotFileError if there is none."""
    if not isinstance(name_or_path, str | Path):
        raise InvalidValue(f"{kind} is {name_or_path!r}; it must be a path, or a name: {', '.join(shipped(folder))}.")
    path, given = Path(name_or_path), str(name_or_path)
    suffixes = ".xml, .mjcf or .urdf" if kind == "robot" else ".xml"
    if path.suffix.lower() == ".xacro":
        urdf = f"{path.stem.removesuffix('.urdf')}.urdf"
        raise RobotFileError(f"{path}: a xacro file must be converted to URDF first. Run: xacro {path.name} > {urdf}")
    if path.suffix or path.name != given:
        if not is_file(path):
            raise RobotFileError(f"{path}: no such file. Give a path to a file ({suffixes}), or a name: {', '.join(shipped(folder))}.")
        return path
    if given not in shipped(folder):
        found = menagerie_file(given) if kind == "robot" else None
        if found is None:
            near = difflib.get_close_matches(given, menagerie_names(), n=3) if kind == "robot" else ()
            raise UnknownName(kind, given, (*shipped(folder), *near))
        return found
    return folder / f"{given}.xml"


def shipped(folder: Path) -> tuple[str, ...]:
    """Return the names of the .xml files of a folder, sorted."""
    return tuple(sorted(path.stem for path in folder.glob("*.xml")))
