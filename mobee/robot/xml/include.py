"""Reads the tag <robot>: another robot file mounted in this one."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from mobee.robot.join import Placed
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import read_urdf
from mobee.robot.xml.file import is_file
from mobee.robot.xml.node import Node, listed, shown
from mobee.robot.xml.volume import AXIS, PLACE, Z, align, direction, turn_about

ROBOTS = Path(__file__).parents[1] / "robots"
INCLUDE_ATTRIBUTES = frozenset({"name", "file", "angle", *PLACE, *AXIS})
DEEPEST = 8  # files that include each other
MOST_FILES = 32  # in one robot: files that include several could grow without end


@dataclass(slots=True)
class Trail:
    """The files that led to the one that is being read, and how many have been read in all."""

    files: tuple[Path, ...] = ()
    counted: list[Path] = field(default_factory=list)

    def into(self, path: Path) -> Trail:
        """The trail inside a file."""
        self.counted.append(path)
        return Trail((*self.files, path.resolve()), self.counted)


def read_include(node: Node, trail: Trail, read: Callable[[Path, Trail], Robot]) -> Placed:
    """The robot of a <robot>, read by `read`, at (px, py, pz), z turned the shortest way to (hx, hy, hz), then by `angle` about it.

    Raises RobotFileError when the file cannot be found, includes itself, or too many are read; errors in it carry its own lines.
    """
    prefix = node.optional("name")
    if prefix and not re.fullmatch("[a-z0-9_]+", prefix):
        node.fail("name", f"{shown(prefix)!r} cannot begin the name of a part", "Use a-z, 0-9 and _ only, or leave it out")
    path = _find(node)
    if path.resolve() in trail.files:
        chain = " -> ".join(file.name for file in (*trail.files, path))
        node.fail("file", f"the file includes itself ({chain})", "Remove one of the <robot> tags")
    if len(trail.files) >= DEEPEST or len(trail.counted) >= MOST_FILES:
        node.fail("file", f"more than {DEEPEST} files inside each other, or {MOST_FILES} in all", "Include fewer robots")
    axis = direction(node, AXIS, (0.0, 0.0, 1.0))
    rotation = turn_about(axis, np.deg2rad(node.number("angle", 0.0))) @ align(Z, axis)
    if path.suffix.lower() == ".urdf":
        trail.into(path)
        robot = read_urdf(path)
    else:
        robot = read(path, trail)
    return Placed(prefix, robot, node.vector(PLACE), rotation)


def _find(node: Node) -> Path:
    """A shipped robot by its name, or a file by its path relative to the one that names it."""
    given = node.text("file")
    shipped = [path.stem for path in ROBOTS.glob("*.xml")]
    path = ROBOTS / f"{given}.xml" if given in shipped else node.file.parent / given
    if not is_file(path):
        node.fail("file", f"{shown(given)!r} is no file", f"Give a path relative to this file, or a shipped robot: {listed(shipped)}")
    return path
