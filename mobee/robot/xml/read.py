# SPDX-License-Identifier: Apache-2.0
"""Reads a robot from zero-position XML, MoBeE's own format for robots (thesis 2.3.1).

A file describes the robot in the pose in which every joint is at 0, with all axes in the root frame. The grammar is in
mobee/robot/robots/README.md.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import get_args

import numpy as np

from mobee.arrays import Ints
from mobee.errors import InvalidValue
from mobee.robot.bodies import one_a_link
from mobee.robot.join import Placed, join_placed
from mobee.robot.pairs import hand_links, joined_links, link_pairs, merged, tested_pairs
from mobee.robot.pairs_2014 import Rule, published_pairs, published_untested
from mobee.robot.robot import Joint, LinkPair, Part, Robot
from mobee.robot.xml.body import (
    CAMERA_ATTRIBUTES,
    CONVEX_ATTRIBUTES,
    MASS_ATTRIBUTES,
    MOST_SHAPES,
    VISUAL_ATTRIBUTES,
    Draft,
    Place,
    enter,
    finished_cameras,
    read_camera,
    read_marker,
    read_mass,
    read_shape,
    read_skeleton,
    read_visual,
)
from mobee.robot.xml.file import is_file
from mobee.robot.xml.motors import finish_joints, order_motors, read_clauses, read_motor
from mobee.robot.xml.node import Node, listed, nearest, read_xml, shown
from mobee.robot.xml.pairs import IGNORE_ATTRIBUTES, without_ignored
from mobee.robot.xml.versions import report, upgrade_robot
from mobee.robot.xml.volume import AXIS, PLACE, STEP, VOLUME_TAGS, Z, align, direction, link_step, turn_about

ROBOTS = Path(__file__).parents[1] / "robots"
INCLUDE_ATTRIBUTES = frozenset({"name", "file", "angle", *PLACE, *AXIS})
DEEPEST_INCLUDE = 8  # files that include each other
MOST_FILES = 32  # in one robot: files that include several could grow without end
MOST_JOINTS = 500  # the number of pairs of links grows with the square
MOST_ELEMENTS_2014 = 500  # the time of the rules in pairs_2014.py grows faster


def finish_robot(root: Node, draft: Draft, name: str) -> Robot:
    """Return the robot of a file, joined with the robots that the file includes.

    `root`: the root element. `draft`: all elements of the file. `name`: name of the robot. Raises RobotFileError if the robot has no body
    part, or if elements of the file do not fit together (for example, a joint names a motor that does not exist).
    """
    if not draft.parts and not draft.others:
        root.fail("bodypart", "the robot has no body part", 'Put its motors and links inside <bodypart name="...">')
    draft.note("robot", name, root)
    draft.note("link", draft.links[0], root)
    robot = _own_robot(root, draft, name)
    if draft.others:
        robot = _with_others(robot, draft)
    return without_ignored(robot, draft.ignores)


def _own_robot(root: Node, draft: Draft, name: str) -> Robot:
    motors = order_motors(draft.motors, draft.parts)
    parts = {part: Part(part, (), 0) for part in draft.parts}
    for part in draft.parts:
        names = tuple(motor.name for motor in motors if motor.part == part)
        if not names:
            draft.parts[part][0].fail("motor", f"part {part!r} has no motor", "Add a <motor> or move its links into another part")
        parts[part] = Part(part, names, next(k for k, motor in enumerate(motors) if motor.part == part))
    joints, table = finish_joints(draft.joints, draft.drives, motors)
    field_pairs, solid_pairs, untested = _pairs(root, draft, joints)
    return Robot(
        name=name,
        links=tuple(draft.links),
        joints=joints,
        motor_table=table,
        parts=parts,
        markers=draft.markers,
        shapes=tuple(draft.shapes),
        clauses=tuple(read_clauses(node, parts[part], motors) for part, node in draft.constraints),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(draft.base_shapes),
        untested=untested,
        where=draft.where,
        bodies=one_a_link(draft.bodies),
        visuals=tuple(draft.visuals),
        cameras=finished_cameras(draft),
        least_lever=root.positive("leastLever") if "leastLever" in root.attributes else 0.0,
    )


def _pairs(root: Node, draft: Draft, joints: tuple[Joint, ...]) -> tuple[Ints, Ints, dict[LinkPair, str]]:
    """Return tested pairs of fields and of solids, and the reasons for pairs of links that are never tested."""
    given = root.choice("adjacency", root.attributes.get("adjacency", "joined"), ("joined", "listed", *get_args(Rule)), "rule")
    if given == "listed":
        return tested_pairs(draft.shapes, "field", {}, own=True), tested_pairs(draft.shapes, "solid", {}), {}
    if given == "joined":
        untested = merged(joined_links(joints), hand_links(draft.subtree, draft.hands))
        return tested_pairs(draft.shapes, "field", untested), tested_pairs(draft.shapes, "solid", untested), untested
    if len(draft.elements) > MOST_ELEMENTS_2014:
        root.fail("adjacency", f"the rule of 2014 is for at most {MOST_ELEMENTS_2014} links and joints", 'Write adjacency="joined"')
    rule: Rule = "published_2014" if given == "published_2014" else "recorded_2014"
    field_pairs, solid_pairs = (published_pairs(draft.elements, draft.hosts, draft.shapes, role, rule) for role in ("field", "solid"))
    tested = link_pairs(draft.shapes, field_pairs, solid_pairs)
    reasons = published_untested(draft.elements, draft.hosts, draft.shapes, rule)
    return field_pairs, solid_pairs, {pair: reason for pair, reason in reasons.items() if pair not in tested}


def _with_others(robot: Robot, draft: Draft) -> Robot:
    """Join the robot of this file, if it has a body, with those that it includes."""
    node, _ = draft.others[-1]
    own = [Placed("", robot)] if draft.parts or draft.shapes or draft.markers or draft.bodies or draft.visuals else []
    placed = own + [other for _, other in draft.others]
    if sum(len(one.robot.shapes) for one in placed) > MOST_SHAPES or sum(len(one.robot.joints) for one in placed) > MOST_JOINTS:
        node.fail("file", f"more than {MOST_SHAPES} shapes or {MOST_JOINTS} joints in all", "Include fewer or simpler robots")
    try:
        joined = join_placed(placed, robot.name)
    except InvalidValue as error:
        node.fail("name", str(error), "Names begin with the name of their <robot>, where it has one")
    return replace(joined, where={("robot", robot.name): robot.where[("robot", robot.name)], **joined.where})


MOST = {
    "joint": MOST_JOINTS,
    "ignore": 20_000,
    "visual": 2000,
}  # of one tag, in a file; 1000 of the others. `write_xml` names every ignored pair
ROOT = "zeropositionkinematictree"
BODY_TAGS = VOLUME_TAGS | {"convex": CONVEX_ATTRIBUTES}
KNOWN = {
    ROOT: frozenset({"version", "robotName", "adjacency", "leastLever"}),
    "bodypart": frozenset({"name"}),
    "link": frozenset({"name", *STEP, "length", "radius", "field", "noSelfCollision", "base"}),
    "joint": frozenset(
        {"name", "moves", "motor", "type", *STEP, "minPos", "maxPos", "length", "radius", "field", "noSelfCollision", "base"}
    ),
    "motor": frozenset({"name", "idx", "unit", "minPos", "maxPos", "home", "velocity", "acceleration", "torque", "zoneEndsAtHome"}),
    "marker": frozenset({"name", *PLACE, "nx", "ny", "nz", "rotation", "turns"}),
    "mass": MASS_ATTRIBUTES,
    "visual": VISUAL_ATTRIBUTES,
    "camera": CAMERA_ATTRIBUTES,
    "constraintlist": frozenset[str](),
    "constraint": frozenset({"a", "q", "b", "negate"}),
    "robot": INCLUDE_ATTRIBUTES,
    "ignore": IGNORE_ATTRIBUTES,
} | {tag: known | {"name", "field", "base", "turns"} for tag, known in BODY_TAGS.items()}


def read_robot(path: Path) -> Robot:
    """Return the robot described by a zero-position XML file of any version (`mobee.robot.xml.versions`).

    Lengths in the file are in m, angles in degrees; everything in the Robot is in SI units (rad), in the root frame at zero pose.
    Raises RobotFileError with file, line, field and remedy; warns of elements that it ignores and faults that it repairs.
    """
    return _read(path, Trail())


def _read(path: Path, trail: Trail) -> Robot:
    root = read_xml(path, repair=True)
    if root.tag != ROOT:
        remedy = "The root of a robot file is <ZeroPositionKinematicTree robotName=...>"
        ending = "; a URDF needs a name that ends in .urdf" if root.tag == "robot" else ""
        root.fail("root element", "this is not a robot", remedy + ending)
    _check_counts(root)
    report(upgrade_robot(root))
    root.check_attributes(KNOWN[ROOT])
    draft, inside = Draft(), trail.into(path)
    for node in root:
        if node.tag == "robot":
            node.check_attributes(KNOWN[node.tag])
            _check_children(node)
            draft.others.append((node, read_include(node, inside, _read)))
    root.children = [node for node in root if node.tag != "robot"]
    _read_tree(root, draft, Place(np.zeros(3), np.zeros(3)))
    return finish_robot(root, draft, root.optional("robotName") or path.stem)


def _check_counts(root: Node) -> None:
    """Raise RobotFileError for files that are implausibly large, which would take minutes to read."""
    counts: Counter[str] = Counter()
    waiting = [root]
    while waiting:
        node = waiting.pop()
        counts[node.tag] += 1
        most = MOST.get(node.tag, 1000)
        if counts[node.tag] > most and node.tag in KNOWN:
            node.fail("size of the file", f"more than {most} of this tag", "Divide the robot, or leave out what does not matter")
        waiting += reversed(node.children)


def _read_tree(root: Node, draft: Draft, place: Place) -> None:
    """Read everything below the root, in the order of the file."""
    waiting = [(child, place) for child in reversed(root.children)]
    while waiting:
        node, place = waiting.pop()
        if node.tag not in KNOWN:
            _warn_unknown(node)
            continue
        node.check_attributes(KNOWN[node.tag])
        inside = READERS.get(node.tag, _misplaced)(node, draft, place)
        if inside is not None:
            waiting += [(child, inside) for child in reversed(node.children)]
        elif node.tag != "constraintlist":  # its reader has checked its rows
            _check_children(node)


def _check_children(node: Node, *valid: str) -> None:
    """Refuse known tags in an element that holds only `valid` ones, and warn of unknown ones."""
    for child in node:
        if child.tag not in KNOWN:
            _warn_unknown(child)
        elif child.tag not in valid:
            holds = f"only <{valid[0]}> stands" if valid else "nothing stands"
            child.fail("position in the file", f"{holds} inside <{node.tag}>", f"Move it behind the <{node.tag}>")
        else:
            child.check_attributes(KNOWN[child.tag])
            _check_children(child)


def _warn_unknown(node: Node) -> None:
    node.warn(f"unknown tag is ignored with all inside. {nearest(node.tag, KNOWN)}Valid: {', '.join(sorted(KNOWN))}")


def _misplaced(node: Node, draft: Draft, place: Place) -> None:
    remedy = f"Move it: <constraint> stands in <constraintList>, <robot> directly in the root, <{ROOT}> only once"
    node.fail("position in the file", "this tag cannot stand here", remedy)


def _read_part(node: Node, draft: Draft, place: Place) -> Place:
    name = node.text("name")
    draft.parts.setdefault(name, []).append(node)
    draft.note("part", name, node)
    return replace(place, part=name)


def _read_motor(node: Node, draft: Draft, place: Place) -> Place:
    if not place.part:
        node.fail("position in the file", "a motor outside of every part", "Move it into a <bodypart>")
    motor = read_motor(node, place.part, draft.motors.values())
    if motor.name in draft.motors:
        remedy = f'rename one, or write <joint motor="{motor.name}"> without a second <motor> where that one is meant'
        if not node.optional("name"):
            remedy = "give this one a name of its own"
        node.fail("name", f"a second motor {motor.name!r}", f"The first is in line {draft.motors[motor.name].node.line}: {remedy}")
    draft.motors[motor.name] = motor
    draft.note("motor", motor.name, node)
    return replace(place, motor=motor.name)


def _read_link(node: Node, draft: Draft, place: Place) -> Place:
    here = enter(
        node,
        draft,
        replace(place, start=place.point, carrier=place.link, base=node.flag("base", default=place.base)),
        f"the link in line {node.line}",
    )
    step, length = link_step(node)
    if place.link == 0 and "name" in node.attributes:
        _name_base(node, draft)
    read_skeleton(node, draft, here, place.point + step / 2, step, length)
    return replace(here, point=place.point + step)


def _name_base(node: Node, draft: Draft) -> None:
    name = node.text("name")
    if name in draft.links[1:]:
        node.fail("name", f"a second link {name!r}", "Give the base a name of its own")
    before = draft.where.get(("link", draft.links[0]))
    if before and name != draft.links[0]:
        problem = f"a second name of the base, {name!r}, replaces {draft.links[0]!r} (line {before.rpartition(':')[2]})"
        node.warn(f"{problem}: links outside of every joint are one link, the base. Keep one name")
    draft.links[0] = name
    draft.note("link", name, node)


def _read_joint(node: Node, draft: Draft, place: Place) -> Place:
    index = len(draft.joints)
    axis = direction(node, STEP)
    length = node.positive("length", float(np.linalg.norm(node.vector(STEP))))
    kind = node.choice("type", node.attributes.get("type", "revolute"), ("revolute", "prismatic", "fixed"), "type of joint")
    if kind == "fixed":
        place = replace(place, start=place.point, carrier=place.link, base=node.flag("base"))
        here = enter(node, draft, place, f"the joint in line {node.line}")
        read_skeleton(node, draft, here, place.point, axis, length)
        return here
    motor = node.optional("motor") or place.motor or node.missing("motor")
    name = node.optional("name") or (motor if all(motor != used for _, used in draft.drives) else f"{motor}_{index}")
    link = node.optional("moves") or name
    if link == draft.links[0]:
        remedy = 'Name another link with moves="..." in the joint, or give the base another name: <link name="...">, outside of every joint'
        node.fail("moves", f"link {link!r} has the name of the base", remedy)
    if link in draft.links or any(name == joint.name for joint in draft.joints):
        node.fail("name", f"a second joint {name!r} or link {link!r}", "Give every joint its own name and every link it moves another")
    draft.joints.append(Joint(name, place.link, "revolute" if kind == "revolute" else "prismatic", axis, place.point, np.zeros(2)))
    draft.drives.append((node, motor))
    draft.links.append(link)
    draft.note("joint", name, node)
    draft.note("link", link, node)
    here = enter(
        node,
        draft,
        replace(place, start=place.point, link=index + 1, carrier=place.link, motor=motor, base=node.flag("base")),
        f"joint {name}",
    )
    draft.subtree.append(here.subtree)
    read_skeleton(node, draft, here, place.point, axis, length)
    return here


def _read_constraints(node: Node, draft: Draft, place: Place) -> None:
    if not place.part:
        node.fail("position in the file", "constraints outside of every part", "Move them into the <bodypart> whose motors they name")
    _check_children(node, "constraint")
    draft.note("clause", str(len(draft.constraints)), node)
    draft.constraints.append((place.part, node))


def _read_ignore(node: Node, draft: Draft, place: Place) -> None:
    draft.ignores.append(node)


@dataclass(slots=True)
class Trail:
    """The files that are being read when robots include other robots.

    `files`: the chain of files from the first one to the current one, each of which includes the next. `counted`: all files read so far,
    for the limit of their number (MOST_FILES).
    """

    files: tuple[Path, ...] = ()
    counted: list[Path] = field(default_factory=list)

    def into(self, path: Path) -> Trail:
        """Return the trail with the file `path` as the current one, and append the file to `counted`."""
        self.counted.append(path)
        return Trail((*self.files, path.resolve()), self.counted)


def read_include(node: Node, trail: Trail, read: Callable[[Path, Trail], Robot]) -> Placed:
    """Read the file that a <robot> element includes, and return its robot, the prefix of its names, and its pose.

    The position of the pose is (px, py, pz) m. Its rotation has two steps: the smallest rotation that takes the z axis to the direction
    (hx, hy, hz), then a turn by `angle` [deg] about this direction. `read`: the function that reads a zero-position XML file. Raises
    RobotFileError if the file is not found or includes itself, or if there are too many files.
    """
    prefix = node.optional("name")
    if prefix and not re.fullmatch("[a-z0-9_]+", prefix):
        node.fail("name", f"{shown(prefix)!r} cannot begin the name of a part", "Use a-z, 0-9 and _ only, or leave it out")
    path = _find(node)
    if path.resolve() in trail.files:
        chain = " -> ".join(file.name for file in (*trail.files, path))
        node.fail("file", f"the file includes itself ({chain})", "Remove one of the <robot> tags")
    if len(trail.files) >= DEEPEST_INCLUDE or len(trail.counted) >= MOST_FILES:
        node.fail("file", f"more than {DEEPEST_INCLUDE} files inside each other, or {MOST_FILES} in all", "Include fewer robots")
    axis = direction(node, AXIS, (0.0, 0.0, 1.0))
    rotation = turn_about(axis, np.deg2rad(node.number("angle", 0.0))) @ align(Z, axis)
    if path.suffix.lower() == ".urdf":
        from mobee.robot.urdf.read import read_urdf  # its modules are many, and few robots include a URDF

        trail.into(path)
        robot = read_urdf(path)
    else:
        robot = read(path, trail)
    return Placed(prefix, robot, node.vector(PLACE), rotation)


def _find(node: Node) -> Path:
    """Return the file of a shipped robot, or a path relative to the including file."""
    given = node.text("file")
    shipped = [path.stem for path in ROBOTS.glob("*.xml")]
    path = ROBOTS / f"{given}.xml" if given in shipped else node.file.parent / given
    if not is_file(path):
        node.fail("file", f"{shown(given)!r} is no file", f"Give a path relative to this file, or a shipped robot: {listed(shipped)}")
    return path


# The reader of each tag; it returns the place for the elements inside, or None if there are none or they have been read.
READERS: dict[str, Callable[[Node, Draft, Place], Place | None]] = {
    "bodypart": _read_part,
    "motor": _read_motor,
    "link": _read_link,
    "joint": _read_joint,
    "marker": read_marker,
    "mass": read_mass,
    "visual": read_visual,
    "camera": read_camera,
    "constraintlist": _read_constraints,
    "ignore": _read_ignore,
    **dict.fromkeys(BODY_TAGS, read_shape),
}
