# SPDX-License-Identifier: Apache-2.0
"""Finds shipped robots by name, and reads any robot file by path."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import TYPE_CHECKING

from mobee.errors import InvalidValue, RobotFileError, UnknownName
from mobee.robot.mjcf.compiled import is_mjcf, menagerie_file, menagerie_names
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
    """Load a shipped robot by name (`mobee.robot.load.shipped_robots`), or a robot from a file.

    Args:
        name_or_path: the name of a shipped robot; the path of a file in URDF (.urdf), MJCF or the format of this library (.xml,
            "zero-position XML", docs/robots.md); or, with the package mujoco-menagerie, a name of MuJoCo Menagerie.
        field: URDF and MJCF: each solid gets a field, a volume that causes a repulsive force. `field` is the distance [m] by which it
            extends beyond the solid. None: no fields.
        meshes: URDF and MJCF: "hull" (the default): a mesh becomes its convex hull; "bounding": the smallest primitive around it.
        corners: URDF and MJCF: the largest number of corners of a mesh's hull (64 by default), or "all" for the exact hull.
        srdf: URDF only: the SRDF file; None: an SRDF beside the URDF or in ../srdf, if there is one (docs/robots.md).
        home: URDF and MJCF: the home pose: the name of a <group_state> of the SRDF or of a keyframe of the MJCF, or "zero"; None: the pose
            that docs/robots.md describes.

    Raises:
        UnknownName: no shipped robot has the name; the message gives the nearest name.
        InvalidValue: an option is not valid for the file.
        RobotFileError: the file cannot be read; the message gives file, line, field and remedy.
        NotInstalled: the file is an MJCF file, and the package mujoco is not installed.
    """
    path = find_file(name_or_path, ROBOTS, "robot")
    is_urdf = path.suffix.lower() == ".urdf"
    if is_urdf or is_mjcf(path):
        from mobee.robot.mjcf.read import read_mjcf  # twelve modules, and no shipped robot needs them
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
    """Return the path of a robot or world file, which is given as a path or as a shipped name.

    `folder`: folder of the shipped files. `kind`: "robot" or another word for the messages; for a robot, names of MuJoCo Menagerie are
    valid too. Raises InvalidValue if the argument is neither text nor a path; UnknownName for an unknown name; RobotFileError if the path
    is not an existing file, if it is a xacro file (not converted to URDF), or if a download fails.
    """
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
    """Return the names of the .xml files of a folder, sorted and without the ending."""
    return tuple(sorted(path.stem for path in folder.glob("*.xml")))
