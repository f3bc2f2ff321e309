# SPDX-License-Identifier: Apache-2.0
"""Runs the checks of a robot (CHECKS), of a world (units, thin obstacles, duplicates), or of a robot or world file.

The findings about a file are the findings about its robot or world, the warnings of the file's reader, and notes on its XML elements, such
as elements of older versions of the format.
"""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path

import numpy as np

from mobee.check.constraints import constraints
from mobee.check.interface import SEVERITIES, Finding, Severity, Subject, length
from mobee.check.motors import coupling, home_limits, home_zones, idle_motors, idle_parts, joint_limits, unreachable_markers
from mobee.check.shapes import fields, hulls, identical_shapes, missing_meshes
from mobee.check.size_and_mass import masses, radians, size
from mobee.check.touching import always_touching, foreign_solids, home_contacts, long_clusters, world_contacts
from mobee.errors import InvalidValue, RobotFileError, Simplified, UnknownName
from mobee.model.world import World, WorldObject
from mobee.model.world_file import WORLDS, load_world, shipped_worlds
from mobee.robot.load import ROBOTS, find_file, load_robot, shipped_robots
from mobee.robot.mjcf.compiled import is_mjcf, menagerie_file
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import Corners
from mobee.robot.urdf.shapes import Meshes
from mobee.robot.xml.file import is_folder
from mobee.robot.xml.node import Node, descendants, read_xml, shown
from mobee.robot.xml.versions import CONVERT, WORLD_TAGS, upgrade_robot, upgrade_world

Check = Callable[[Subject], Iterator[Finding]]

KEY = re.compile(r"[a-z0-9_]+")  # a name that is valid in a key of the bus
# A file name may contain ":3: " too, so the place is best found by the ending of the name.
MESSAGE = re.compile(
    r"(?P<where>(?:.+?\.(?:xml|mjcf|urdf|srdf)|.+?):\d+): (?P<what>[^.]*(?:\.[^ ][^.]*)*)\.? ?(?P<remedy>.*)", re.DOTALL | re.IGNORECASE
)
FAR = 10.0  # m from the origin: no robot reaches there
TINY = 1e-3  # m
THIN = 0.02  # m: at 2 m/s and 100 Hz a hand moves this far between two ticks


def check_robot(robot: Robot, world: World | None = None) -> list[Finding]:
    """Return all findings about a robot, errors first.

    `world`: a world; the objects that the robot touches in it at home are reported too. Poses are sampled with a fixed seed, so that the
    same robot always gets the same findings. Raises InvalidValue if `robot` or `world` has another type.
    """
    if not isinstance(robot, Robot):
        raise InvalidValue(f"robot is {robot!r}; it must be a Robot, as load_robot returns it.")
    if not isinstance(world, World | None):
        raise InvalidValue(f"world is {world!r}; it must be a World, as load_world returns it, or None.")
    subject = Subject(robot, world)
    with np.errstate(invalid="ignore"):  # joints without limits are a finding, not a failure of the others
        found = [finding for check in CHECKS for finding in check(subject)]
    return sorted(found, key=lambda finding: SEVERITIES.index(finding.severity))


def names_differing_in_case(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each name that differs from another name of its kind (part, link, motor, ...) in upper and lower case only."""
    robot = subject.robot
    kinds: dict[str, Iterable[str]] = {
        "part": robot.parts,
        "link": robot.links,
        "joint": (joint.name for joint in robot.joints),
        "motor": robot.motors,
        "marker": robot.markers,
        "shape": (shape.name for shape in robot.shapes),
    }
    for kind, names in kinds.items():
        seen: dict[str, str] = {}
        for name in names:
            before = seen.setdefault(name.lower(), name)
            if before != name:
                yield Finding(
                    "warning",
                    "name-case",
                    subject.where(kind, name),
                    f"{kind} {name!r} differs from {kind} {before!r} in upper and lower case only",
                    "names are case-sensitive, and people overlook the difference",
                    "rename one of the two",
                )


def unusable_names(subject: Subject) -> Iterator[Finding]:
    """Yield a finding (a problem of the file) for each name of a part or motor that other programs cannot use.

    The name of a part must be valid in a key (a topic) of the message bus: a-z, 0-9 and _ only. The name of a motor must not have blanks or
    commas, which separate the names in lists of motors.
    """
    for part in subject.robot.parts:
        if not KEY.fullmatch(part):
            yield Finding(
                "warning",
                "part-name",
                subject.where("part", part),
                f"part name {part!r} is not valid in a key of the bus",
                "the services name their keys after the parts, so that none of them can run this robot",
                "rename it: a-z, 0-9 and _ only",
            )
    for motor in subject.robot.motors:
        if re.search(r"[\s,]", motor):
            yield Finding(
                "warning",
                "motor-name",
                subject.where("motor", motor),
                f"motor name {motor!r} contains a space or a comma",
                "lists of motors are separated by these, so that no constraint can name it",
                "rename it, with _ instead",
            )


CHECKS: tuple[Check, ...] = (
    joint_limits,
    home_limits,
    home_zones,
    coupling,
    idle_motors,
    idle_parts,
    size,
    radians,
    always_touching,
    long_clusters,
    home_contacts,
    world_contacts,
    foreign_solids,
    fields,
    constraints,
    unreachable_markers,
    masses,
    missing_meshes,
    identical_shapes,
    names_differing_in_case,
    unusable_names,
)


def source(root: Node) -> Iterator[Finding]:
    """Yield findings about the XML elements of a world file, or of a robot file in zero-position XML, MoBeE's own format for robots.

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
    """Raise RobotFileError if the argument is the path of a folder, and UnknownName if it is a name that no robot and no world has.

    Raises InvalidValue if it is neither text nor a path.
    An argument without a folder and without a suffix (such as .xml) counts as a name.
    """
    known = {*shipped_robots(), *shipped_worlds()}
    if not isinstance(name_or_path, str | Path):
        raise InvalidValue(f"name_or_path is {name_or_path!r}; it must be a path, or a name: {', '.join(sorted(known))}.")
    given, path = str(name_or_path), Path(name_or_path)
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
        found = MESSAGE.match(str(warning.message))
        where, what, remedy = found.group("where", "what", "remedy") if found else ("", str(warning.message), "")
        severity: Severity = "note" if issubclass(warning.category, Simplified) else "warning"
        warned.append(Finding(severity, "reader", where, what, "the robot differs from what the file says", remedy))


def check_world(world: World, lines: Mapping[str, str]) -> list[Finding]:
    """Return all findings about a world; `lines`: dict from the name of each object to its place in the file, "file:line"."""
    found = [finding for thing in world.objects.values() for finding in _check_object(thing, lines.get(thing.name, thing.name))]
    return found + list(_duplicates(world, lines))


def _check_object(thing: WorldObject, where: str) -> Iterator[Finding]:
    thinnest = _thinnest(thing)
    if max(np.abs(thing.position).max(), *thing.size) > FAR:
        yield Finding(
            "warning",
            "unit",
            where,
            f"object {thing.name!r} is larger or farther away than {length(FAR)}",
            "lengths are in metres, and no robot reaches there",
            "divide by 1000 if the numbers are millimetres",
        )
    elif max(thing.size) < TINY:
        yield Finding(
            "warning",
            "unit",
            where,
            f"object {thing.name!r} is smaller than {length(TINY)}",
            "lengths are in metres",
            "multiply its sizes if they were written in a larger unit",
        )
    elif thing.role == "obstacle" and thinnest < THIN:
        yield Finding(
            "note",
            "thin",
            where,
            f"obstacle {thing.name!r} is {length(thinnest)} thin",
            "a fast hand can pass through it between two ticks, and is then pushed out on the wrong side",
            "make it thicker on the side that nothing can come from",
        )


def _thinnest(thing: WorldObject) -> float:
    return min(thing.size) if thing.kind == "box" else min(2 * thing.size[0], *thing.size[1:], np.inf)


def _duplicates(world: World, lines: Mapping[str, str]) -> Iterator[Finding]:
    for one, other in combinations(world.objects.values(), 2):
        same = (one.kind, one.size) == (other.kind, other.size) and np.allclose(one.position, other.position, atol=1e-6)
        if same and np.allclose(one.rotation, other.rotation, atol=1e-6):
            yield Finding(
                "warning",
                "duplicate",
                lines.get(other.name, other.name),
                f"object {other.name!r} is a duplicate of {one.name!r}: same kind, size and position",
                "contacts with it push twice as hard",
                "remove one of the two",
            )
        if one.name.lower() == other.name.lower():
            yield Finding(
                "warning",
                "name-case",
                lines.get(other.name, other.name),
                f"object {other.name!r} differs from {one.name!r} in upper and lower case only",
                "names are case-sensitive, and people overlook the difference",
                "rename one of the two",
            )
