# SPDX-License-Identifier: Apache-2.0
"""Checks a robot or world file: warnings while it is read, elements of older versions of the format, and its content."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from mobee.check.finding import SEVERITIES, Finding, Severity
from mobee.check.robot import check_robot
from mobee.check.shapes import hulls
from mobee.check.world import check_world
from mobee.errors import InvalidValue, RobotFileError, Simplified, UnknownName
from mobee.model.world import World
from mobee.model.world_file import WORLDS, load_world, shipped_worlds
from mobee.robot.load import ROBOTS, find_file, load_robot, shipped_robots
from mobee.robot.mjcf.compiled import is_mjcf
from mobee.robot.mjcf.menagerie import menagerie_file
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import Corners
from mobee.robot.urdf.shapes import Meshes
from mobee.robot.xml.file import is_folder
from mobee.robot.xml.node import Node, descendants, read_xml, shown
from mobee.robot.xml.versions import CONVERT, WORLD_TAGS, upgrade_robot, upgrade_world


def source(root: Node) -> Iterator[Finding]:
    """Yield findings about the XML elements of a robot file in zero-position XML, or of a world file.

    `root`: the root element; elements of older versions of the format are rewritten to the present version, in place.
    """
    where = f"{root.file}:{root.line}"
    yield from _empty_names(root)
    remarks = upgrade_world(root) if root.tag in WORLD_TAGS else upgrade_robot(root)
    for remark in remarks:
        if remark.severity == "note":  # the reader has warned of the others
            yield Finding(
                "note",
                "older-version",
                f"{remark.node.file}:{remark.node.line}",
                remark.what,
                "the file is of an older version, and this is how it was understood",
                remark.remedy or CONVERT,
            )
    if root.tag != "world" and not root.optional("robotName"):
        yield Finding(
            "note",
            "robot-name",
            where,
            f"the robot has no robotName: it is called {root.file.stem!r}, after its file",
            "services find each other by this name, and a copy of the file under another name would be another robot",
            f'add robotName="{root.file.stem}"',
        )


def _empty_names(root: Node) -> Iterator[Finding]:
    for node in descendants(root):
        if "name" in node.attributes and not node.optional("name") and node.tag != "world":
            yield Finding(
                "warning",
                "empty-name",
                f"{node.file}:{node.line}",
                f"<{shown(node.tag)}> has an empty name",
                "it is named by a number, which changes when elements are added before it",
                "write a name, or leave the attribute out",
            )


@dataclass(frozen=True, slots=True)
class Checked:
    """The content of a robot or world file, and the findings about it, errors first."""

    content: Robot | World
    findings: tuple[Finding, ...]


def check_file(
    name_or_path: str | Path,
    world: World | None = None,
    *,
    field: float | None = None,
    meshes: Meshes | None = None,
    corners: Corners | None = None,
    srdf: str | Path | None = None,
    home: str | None = None,
) -> Checked:
    """Check a shipped robot or world, or a robot or world file; return its content and all findings, errors first.

    `name_or_path`: name of a shipped robot or world, or path of a file. `world`: a world; the objects that the robot touches in it at home
    are reported too. The other arguments are options for reading a URDF or MJCF file, as in `mobee.robot.load.load_robot`. `field`:
    distance [m] by which the fields (volumes that cause repulsive forces) extend beyond the solids. `meshes`: "hull" or "bounding", the
    shapes for meshes. `corners`: largest number of corners of a hull, or "all". `srdf`: the SRDF file. `home`: name of the home pose.
    Raises RobotFileError, UnknownName or InvalidValue if the file cannot be read, or if an option is not valid for the file; NotInstalled
    for an MJCF file without the package mujoco.
    """
    _require_known(name_or_path)
    path = world_file(name_or_path)
    warned: list[Finding] = []
    content: Robot | World
    if path is None:
        with _collected_warnings(warned):
            content = load_robot(name_or_path, field=field, meshes=meshes, corners=corners, srdf=srdf, home=home)
        found = check_robot(content, world)
        file = find_file(name_or_path, ROBOTS, "robot")
        if file.suffix.lower() != ".urdf" and not is_mjcf(file):
            found += source(read_xml(file, repair=True))
        elif corners != "all" and any(shape.vertices is not None for shape in content.shapes):
            with _collected_warnings([]):
                exact = load_robot(name_or_path, field=field, meshes=meshes, corners="all", srdf=srdf, home=home)
            found += hulls(content, exact)
    elif world is not None or any(option is not None for option in (field, meshes, corners, srdf, home)):
        raise InvalidValue(f"{path} is a world: it is checked alone, without another world and without options of a URDF.")
    else:
        with _collected_warnings(warned):
            content = load_world(path)
        root = read_xml(path, repair=True)
        source_findings = list(source(root))
        lines = {node.attributes.get("name", "").strip(): f"{node.file}:{node.line}" for node in root}
        found = check_world(content, lines) + source_findings
    return Checked(content, tuple(sorted(warned + found, key=lambda finding: SEVERITIES.index(finding.severity))))


def _require_known(name_or_path: str | Path) -> None:
    """Raise RobotFileError for a folder, and UnknownName for a name of neither a robot nor a world."""
    given, path = str(name_or_path), Path(name_or_path)
    known = {*shipped_robots(), *shipped_worlds()}
    if given in known:
        return
    if is_folder(path):
        raise RobotFileError(f"{path}: is a folder. Give the path of a .xml or .urdf file in it.")
    if not path.suffix and path.name == given and menagerie_file(given) is None:
        raise UnknownName("robot or world", given, known)


def world_file(name_or_path: str | Path) -> Path | None:
    """Return the path of a world file, given its path or the name of a shipped world.

    None if the argument is the name or file of a robot, or if there is no such XML file.
    """
    given, path = str(name_or_path), Path(name_or_path)
    if given in shipped_worlds() and given not in shipped_robots():
        return WORLDS / f"{given}.xml"
    if path.suffix.lower() != ".xml" or not path.is_file():
        return None
    return path if read_xml(path, repair=True).tag in WORLD_TAGS else None


@contextmanager
def _collected_warnings(warned: list[Finding]) -> Iterator[None]:
    """Collect the warnings of a reader as findings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for warning in caught:
        found = re.match(r"(?P<where>.+?:\d+): (?P<what>[^.]*(?:\.[^ ][^.]*)*)\.? ?(?P<remedy>.*)", str(warning.message), re.DOTALL)
        where, what, remedy = found.group("where", "what", "remedy") if found else ("", str(warning.message), "")
        severity: Severity = "note" if issubclass(warning.category, Simplified) else "warning"
        warned.append(Finding(severity, "reader", where, what, "the robot differs from what the file says", remedy))
