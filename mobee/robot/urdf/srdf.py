# SPDX-License-Identifier: Apache-2.0
"""Reads an SRDF: pairs of links that are not tested for contacts, groups of joints, named poses, and which of these poses is home."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from math import atan2, pi, remainder
from pathlib import Path

import numpy as np

from mobee.errors import Simplified, UnknownName
from mobee.robot.robot import Motor
from mobee.robot.urdf.motors import Drive
from mobee.robot.urdf.tree import Tree, UrdfJoint, bounded, child
from mobee.robot.xml.node import Node, nearest, read_xml, shown

NamePair = frozenset[str]
MOST_GROUPS = 200
MOST_COMPARED = 100  # names that a misspelt one is compared with
FREE_BASE = "root_joint"  # Pinocchio's name for the joint that lets a base move freely, in files without a <virtual_joint>


@dataclass(slots=True, eq=False)
class Srdf:
    """The content of an SRDF file; links and joints have the names of the URDF.

    `disabled`: pairs of links that are not tested for contacts -> reason, file and line. `enabled`: pairs of links that are tested even if
    they are adjacent. `groups`: name -> its element and its joints, in the order of the file. `states`: name of a <group_state> -> the
    positions of its joints (`State`); the states of several groups with one name are merged. `path`: path of the file; None: the robot has
    no SRDF.
    """

    disabled: dict[NamePair, str] = field(default_factory=dict)
    enabled: set[NamePair] = field(default_factory=set)
    groups: dict[str, tuple[Node, tuple[str, ...]]] = field(default_factory=dict)
    states: dict[str, State] = field(default_factory=dict)
    path: Path | None = None


def find_srdf(urdf: Path, robot: str) -> Path | None:
    """Return the path of the SRDF of a URDF: it has the name of the URDF file, or else that of the robot, and the ending .srdf.

    It is searched for in the folder of the URDF and in ../srdf; upper and lower case do not matter. Returns None if there is no such file.
    """
    folders = (urdf.resolve().parent, urdf.resolve().parent.parent / "srdf")
    for name in dict.fromkeys((urdf.stem.lower(), robot.lower())):
        for folder in folders:
            found = sorted(path for path in folder.glob("*.[sS][rR][dD][fF]") if path.stem.lower() == name and path.is_file())
            if found:
                return found[0]
    return None


def read_srdf(path: Path, tree: Tree) -> Srdf:
    """Return the content of an SRDF file; warns of links, joints and groups that the robot does not have, and of passive joints.

    `tree`: links and joints of the robot's URDF. Raises RobotFileError if the file cannot be read, is not an SRDF file, has too many
    groups, or has a missing or faulty attribute.
    """
    root = read_xml(path)
    if root.tag != "robot":
        root.fail("root element", "this is not an SRDF file", "Its root is <robot name=...>")
    srdf = Srdf(path=path)
    groups = {node.text("name"): node for node in root if node.tag == "group"}
    if len(groups) > MOST_GROUPS:
        root.fail("group", f"has {len(groups)} groups", f"Write one group per part; at most {MOST_GROUPS} can be read")
    virtual = {FREE_BASE, *(node.text("name") for node in root if node.tag == "virtual_joint")} - set(tree.joints)
    for name, node in groups.items():
        joints = dict.fromkeys(_joints_of(node, groups, tree, virtual))
        srdf.groups[name] = (node, tuple(joints))
    silent = [name for node in root if node.tag == "disable_default_collisions" for name in _known(node, "link", tree.links)]
    for name in silent:
        reason = f"disabled in the SRDF by default ({path.name})"
        srdf.disabled |= {frozenset((name, other)): reason for other in tree.links if other != name}
    for node in root:
        if node.tag not in ("disable_collisions", "enable_collisions"):
            continue
        pair = frozenset(name for end in ("link1", "link2") for name in _known(node, end, tree.links))
        if len(pair) != 2:
            continue
        if node.tag == "disable_collisions":
            reason = node.optional("reason")
            srdf.disabled[pair] = f"disabled in the SRDF{': ' if reason else ''}{reason} ({path.name}, line {node.line})"
        else:
            srdf.disabled.pop(pair, None)
            srdf.enabled.add(pair)
    for node in root:
        if node.tag == "group_state":
            srdf.states.setdefault(node.text("name"), {}).update(read_state(node, tree.joints, virtual))
        elif node.tag == "passive_joint" and node.text("name") not in virtual:
            for name in _known(node, "name", tree.joints):
                if tree.joints[name].kind != "fixed" and child(tree.joints[name].node, "mimic") is None:
                    remedy = 'If it follows another joint, write <mimic> in the URDF; if nothing moves it, write type="fixed"'
                    node.warn(f"joint {name!r} gets a motor, as this library has no passive joints. {remedy}", Simplified)
    return srdf


def _known(node: Node, attribute: str, valid: Mapping[str, object]) -> Iterable[str]:
    """Return the name in a tuple if the robot has it, else warn and return (): robots with different grippers often share an SRDF."""
    name = node.text(attribute)
    if name in valid:
        return (name,)
    near = nearest(name, valid) if len(valid) <= MOST_COMPARED else ""  # a file may hold thousands of such lines
    node.warn(f"the robot has no {shown(name)!r}, so this is ignored. {near}")
    return ()


def _joints_of(group: Node, groups: Mapping[str, Node], tree: Tree, virtual: Collection[str]) -> Iterable[str]:
    """Return the joints of a group and of its subgroups, without virtual joints; a group that contains itself is read only once."""
    above = {joint.child: joint for joint in tree.joints.values()}
    seen = {group.text("name")}
    stack = list(reversed(group.children))
    while stack:
        node = stack.pop()
        if node.tag == "joint" and node.optional("name") not in virtual:
            yield from _known(node, "name", tree.joints)
        elif node.tag == "link":
            yield from (above[name].name for name in _known(node, "name", tree.links) if name in above)
        elif node.tag == "group":
            for name in _known(node, "name", groups):
                if name not in seen:
                    seen.add(name)
                    stack += reversed(groups[name].children)
        elif node.tag == "chain":
            yield from _chain(node, tree)


def _chain(node: Node, tree: Tree) -> list[str]:
    """Return the joints on the path between two links, in order; for links on different branches it passes the link that carries both."""
    ends = [name for end in ("base_link", "tip_link") for name in _known(node, end, tree.links)]
    if len(ends) != 2:
        return []
    base, tip = ends
    up, down = _to_root(base, tree), _to_root(tip, tree)
    while up and down and up[-1] is down[-1]:
        up.pop()
        down.pop()
    return [joint.name for joint in (*up, *reversed(down))]


def _to_root(link: str, tree: Tree) -> list[UrdfJoint]:
    above = {joint.child: joint for joint in tree.joints.values()}
    joints: list[UrdfJoint] = []
    while link in above:
        joints.append(above[link])
        link = above[link].parent
    return joints


def read_parts(srdf: Srdf, masters: Iterable[str], drives: Mapping[str, Drive]) -> dict[str, tuple[str, ...]]:
    """Return the parts of the robot: name of the part -> names of the joints that the motors of the part move directly.

    The parts are the groups of the SRDF that contain no other group, if every motor is in exactly one of them; else there is one part,
    "all". `masters`: names of all joints that a motor moves directly. `drives`: the drive of each joint, by name.
    """
    everything = tuple(masters)
    motors: dict[str, tuple[str, ...]] = {}
    for name, (_, joints) in srdf.groups.items():
        mine = tuple(dict.fromkeys(drives[joint].master for joint in joints if joint in drives))
        if mine and set(mine) not in map(set, motors.values()):
            motors[name] = mine
    parts = {name: mine for name, mine in motors.items() if not any(set(other) < set(mine) for other in motors.values())}
    dealt = [master for mine in parts.values() for master in mine]
    if parts and sorted(dealt) == sorted(everything):
        return parts
    if parts:
        odd = sorted(master for master in everything if dealt.count(master) != 1)
        node = srdf.groups[next(iter(parts))][0]
        node.warn(f"the groups do not give every motor one part ({', '.join(odd[:4])}), so the robot has one part, all")
    return {"all": everything}


HOMES = ("home", "ready", "half_sitting", "standing", "default")  # the first of these names in an SRDF is home
ZERO = "zero"  # a home that every robot has, unless its SRDF gives the name to another pose
BEYOND = 1e-6  # rad or m, of a limit, by rounding

State = dict[str, tuple[Node, float]]  # joint -> its line in the SRDF, and its position [rad or m]


@dataclass(frozen=True, slots=True)
class Home:
    """A home pose.

    `name`: name of the pose. `state`: joint -> its line in the SRDF, and its position [rad or m]. `meant`: whether the pose is named "home"
    or was requested, so that a position beyond the limits is an error.
    """

    name: str
    state: State
    meant: bool


def read_state(group_state: Node, joints: Mapping[str, UrdfJoint], elsewhere: Collection[str]) -> State:
    """Return the positions of the moving joints in a <group_state>: joint -> its line in the SRDF, and its position [rad or m].

    `joints`: joints of the URDF, by name. `elsewhere`: names of virtual joints, which place the robot in the world; they are skipped. Warns
    of other names that are not joints of the robot.
    """
    found: State = {}
    for node in group_state:
        name = node.text("name")
        if name in joints and joints[name].kind != "fixed":
            found[name] = node, _value(node, joints[name])
        elif name not in joints and name not in elsewhere:
            node.warn(f"the robot has no joint {name!r}, so this is ignored")
    return found


def _value(node: Node, joint: UrdfJoint) -> float:
    """Return the position of a joint in a pose; a continuous joint may have a cosine and a sine, or any number of turns."""
    if joint.kind != "continuous":
        return bounded(node, "value")
    numbers = node.numbers("value") if "value" in node.attributes else [bounded(node, "value")]
    if len(numbers) not in (1, 2):
        node.fail("value", f"has {len(numbers)} numbers", "Write the angle in radians")
    angle = numbers[0] if len(numbers) == 1 else atan2(numbers[1], numbers[0])
    return angle if abs(angle) <= pi + BEYOND else remainder(angle, 2.0 * pi)


def choose_home(states: Mapping[str, State], asked: str | None, srdf: Path | None) -> Home:
    """Return the home pose of a robot.

    `states`: the poses in the SRDF, by name. `asked`: name of the requested pose, or "zero". If it is None, the result is the first of
    these that exists: a pose with a name of the list HOMES ("home", "ready", ..., in this order); the only pose of the SRDF, if it has just
    one; "zero". The pose "zero" has no positions, unless the SRDF has a pose of this name. `srdf`: path of the SRDF, for the error message.
    In names, upper and lower case do not matter. Raises UnknownName, with the valid names, if there is no pose `asked`.
    """
    lower = {name.lower(): name for name in states}
    if asked is not None:
        if asked.lower() not in (*lower, ZERO):
            raise UnknownName(f"home ({srdf or 'no SRDF was found'})", asked, (*states, ZERO))
        name = lower.get(asked.lower(), ZERO)
        return Home(name, states.get(name, {}), meant=True)
    known = next((lower[name] for name in HOMES if name in lower), None)
    name = known or (next(iter(states)) if len(states) == 1 else lower.get(ZERO, ZERO))
    return Home(name, states.get(name, {}), meant=name.lower() == HOMES[0])


def homed(motor: Motor, home: Home, moving: list[UrdfJoint]) -> Motor:
    """Return a copy of the motor with the home position that the pose `home` gives it.

    The motor is returned unchanged if the pose has none of its joints. `moving`: the joints of the robot. A home beyond the motor's limits
    raises RobotFileError if `home.meant` is True; else it causes a warning, and the nearest limit becomes the home.
    """
    for index, scale, offset in motor.joints:
        if moving[index].name not in home.state:
            continue
        node, value = home.state[moving[index].name]
        place = (value - offset) / scale
        low, high = motor.limits
        if not low - BEYOND <= place <= high + BEYOND:
            problem = f"{value:g} puts {motor.name!r} outside of {low:g} .. {high:g}"
            if home.meant:
                node.fail("value", problem, "Choose a home within the limits")
            node.warn(f"{problem}, so its home is the nearest limit. Correct the value, or choose another home")
        return replace(motor, home=float(np.clip(place, low, high)))
    return motor
