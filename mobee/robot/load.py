"""Finds shipped robots and worlds by name, and reads any robot or world file by path."""

from __future__ import annotations

from pathlib import Path

from mobee.collision.world import World
from mobee.errors import RobotFileError, UnknownName
from mobee.robot.robot import Robot
from mobee.robot.xml_world import read_world
from mobee.robot.zero_position import read_robot

ROBOTS = Path(__file__).parent / "robots"
WORLDS = Path(__file__).parent / "worlds"


def load_robot(name_or_path: str | Path) -> Robot:
    """A shipped robot by name (see shipped_robots), or the robot of a zero-position .xml file.

    Raises UnknownName with the nearest shipped name, or RobotFileError with file, line, field and remedy.
    """
    return read_robot(find_file(name_or_path, ROBOTS, "robot"))


def shipped_robots() -> tuple[str, ...]:
    """Names of the robots that come with this library, sorted."""
    return shipped(ROBOTS)


def load_world(name_or_path: str | Path) -> World:
    """A shipped world by name (see shipped_worlds), or the world of an .xml file; errors as load_robot."""
    return read_world(find_file(name_or_path, WORLDS, "world"))


def shipped_worlds() -> tuple[str, ...]:
    """Names of the worlds that come with this library, sorted."""
    return shipped(WORLDS)


def find_file(name_or_path: str | Path, folder: Path, kind: str) -> Path:
    """The .xml file that a shipped name or a path stands for."""
    path, given = Path(name_or_path), str(name_or_path)
    if path.suffix == ".urdf":
        raise RobotFileError(f"{path}: URDF files cannot be read yet. Describe the {kind} in zero-position XML (robots/README.md).")
    if path.suffix or path.name != given:
        if not path.is_file():
            raise RobotFileError(f"{path}: no such file. Give a path to an .xml file, or a name: {', '.join(shipped(folder))}.")
        return path
    if given not in shipped(folder):
        raise UnknownName(kind, given, shipped(folder))
    return folder / f"{given}.xml"


def shipped(folder: Path) -> tuple[str, ...]:
    """Names of the .xml files of a folder, sorted."""
    return tuple(sorted(path.stem for path in folder.glob("*.xml")))
