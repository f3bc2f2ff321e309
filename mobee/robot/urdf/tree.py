# SPDX-License-Identifier: Apache-2.0
"""Reads the links, joints and frames of a URDF as a checked tree.

A frame is an element `<origin xyz=... rpy=...>`; rpy are rotations about the fixed axes x, y, z in that order.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from math import atan2, cos, hypot, sin
from typing import NoReturn

import numpy as np

from mobee.arrays import Array
from mobee.robot.xml.node import Node, listed, nearest, shown

FARTHEST = 1e6  # m: a larger number is a mistake, and the arithmetic would lose millimetres
MOVING = ("revolute", "continuous", "prismatic")
MOST_LINKS = 1000
LONGEST_NAME = 200
JOINT_TAGS = ("origin", "parent", "child", "axis", "calibration", "dynamics", "limit", "mimic", "safety_controller", "mobee")
JOINT_ATTRIBUTES = {"axis": ("xyz",), "limit": ("lower", "upper", "velocity", "effort"), "mimic": ("joint", "multiplier", "offset")}
XACRO_DEFINITIONS = ("property", "arg", "macro")
FREE = {
    "floating": "moves freely in space, which this library has no joint for",
    "planar": "moves freely in a plane, which this library has no joint for",
}


@dataclass(frozen=True, slots=True, eq=False)
class UrdfJoint:
    """A joint of a URDF.

    `node`: its XML element. `kind`: "revolute", "continuous", "prismatic" or "fixed". `parent`, `child`: names of the links that it
    connects. `origin`: its frame in the frame of the parent link. `axis`: (3,) unit vector in the joint's own frame.
    """

    node: Node
    name: str
    kind: str
    parent: str
    child: str
    origin: Frame
    axis: Array


@dataclass(slots=True, eq=False)
class Tree:
    """The links (as XML elements) and joints of a URDF, by name.

    `root`: the link that no joint moves. `below`: link -> the joints that it carries, in the order of the file.
    """

    root: str
    links: dict[str, Node]
    joints: dict[str, UrdfJoint]
    below: dict[str, list[UrdfJoint]] = field(default_factory=dict)

    def walk(self) -> Iterator[UrdfJoint]:
        """Yield every joint in depth-first order: a joint before those that it carries, and siblings in the order of the file."""
        stack = list(reversed(self.below.get(self.root, ())))
        while stack:
            joint = stack.pop()
            yield joint
            stack += reversed(self.below.get(joint.child, ()))


def read_tree(robot: Node) -> Tree:
    """Return the checked tree of a <robot>; warns of misspelt attributes of its joints.

    Raises RobotFileError for duplicate names, missing links, loops, a second root, and tags that xacro has not replaced.
    """
    _refuse_xacro(robot)
    links: dict[str, Node] = {}
    joints: dict[str, UrdfJoint] = {}
    for node in robot:
        if node.tag == "link":
            name = read_name(node)
            if name in links:
                _twice(node, links[name])
            links[name] = node
        elif node.tag == "joint":
            name = read_name(node)
            if name in joints:
                _twice(node, joints[name].node)
            joints[name] = _read_joint(node)
    if not links:
        robot.fail("link", "the robot has no link", 'Add <link name="base"/>, or check that this is the file that xacro wrote')
    if len(links) > MOST_LINKS:
        robot.fail("link", f"has {len(links)} links", f"Remove what does not move: at most {MOST_LINKS} can be read")
    return _connect(robot, links, joints)


def _refuse_xacro(robot: Node) -> None:
    """Raise RobotFileError for the first tag of xacro in the root, in a link or in a joint; the other elements are not read."""
    # Only the namespace makes a tag one of xacro, so a file may give it another prefix.
    bound = [name[6:].lower() for name, value in robot.attributes.items() if name.startswith("xmlns:") and value.endswith("xacro")]
    prefixes = {"xacro", *bound}
    for part in robot:
        waiting = [part]
        while waiting:
            node = waiting.pop()
            prefix, colon, tag = node.tag.partition(":")
            if colon and prefix in prefixes:
                # A definition alone adds nothing, so a robot with a leftover one is complete. Every other tag (an include, a condition, the
                # call of a macro) stands for content that may be links: without an error a hand would be missing from all contact tests.
                if tag in XACRO_DEFINITIONS:
                    continue
                remedy = f"Run xacro first: xacro {node.file.name} > {node.file.stem}_expanded.urdf, then use the new file"
                node.fail("tag", "this tag of xacro is not replaced by its content, so a part of the robot is missing", remedy)
            if part.tag in ("link", "joint"):
                waiting += reversed(node.children)


def check_spelling(node: Node, known: Collection[str]) -> None:
    """Warn of each attribute that is similar to one of the `known` names that the element does not have.

    Other unknown attributes cause no warning, since programs add their own (`<limit acceleration=...>`, `drake:effort`). For the same
    reason an attribute is no misspelling if the known one is there too (`effort` and `max_effort`).
    """
    absent = [name for name in known if name not in node.attributes]
    for name in node.attributes:
        if name not in known and ":" not in name and (near := nearest(name, absent)):
            node.warn(f"unknown attribute {shown(name)!r} is ignored. {near}Valid: {listed(known)}")


def read_name(node: Node, attribute: str = "name") -> str:
    """Return the name in an attribute; raises RobotFileError if it is empty, blank, or longer than LONGEST_NAME (200) letters."""
    name = node.text(attribute)
    if len(name) > LONGEST_NAME:
        node.fail(attribute, f"{shown(name)!r} has {len(name)} letters", f"Give it a name of at most {LONGEST_NAME}")
    return name


def _twice(node: Node, first: Node) -> NoReturn:
    node.fail("name", f"a second {node.tag} {node.text('name')!r}", f"The first is in line {first.line}: rename one")


def _read_joint(node: Node) -> UrdfJoint:
    for inner in node:
        if inner.tag not in JOINT_TAGS and nearest(inner.tag, JOINT_TAGS):
            inner.warn(f"unknown tag is ignored. {nearest(inner.tag, JOINT_TAGS)}")
    kind = node.text("type").lower()
    if kind in FREE:
        remedy = 'Write type="fixed" where the robot stands; for a moving base write prismatic and revolute joints, one after the other'
        node.fail("type", f"a {kind} joint {FREE[kind]}", remedy)
    node.choice("type", kind, (*MOVING, "fixed"), "type of joint")
    for inner in node:
        if kind != "fixed" and inner.tag in JOINT_ATTRIBUTES:  # a fixed joint needs none of them
            known = JOINT_ATTRIBUTES[inner.tag]
            check_spelling(inner, [name for name in known if kind != "continuous" or name not in ("lower", "upper")])
    return UrdfJoint(node, node.text("name"), kind, _end(node, "parent"), _end(node, "child"), read_origin(node), _axis(node, kind))


def _end(node: Node, tag: str) -> str:
    end = child(node, tag)
    if end is None:
        node.fail(tag, "is required and missing", f'Add <{tag} link="..."/>')
    return end.text("link")


def _axis(node: Node, kind: str) -> Array:
    axis = child(node, "axis")
    if kind == "fixed" or axis is None or "xyz" not in axis.attributes:
        return np.array([1.0, 0.0, 0.0])  # the default that URDF gives it
    vector = triple(axis, "xyz")
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        axis.fail("xyz", "the axis has no length", "Write the direction of the axis in the joint's frame, such as 0 0 1")
    return vector / length


def _connect(robot: Node, links: dict[str, Node], joints: dict[str, UrdfJoint]) -> Tree:
    moved: dict[str, UrdfJoint] = {}
    below: dict[str, list[UrdfJoint]] = {}
    for joint in joints.values():
        for end, name in (("parent", joint.parent), ("child", joint.child)):
            if name not in links:
                joint.node.fail(end, f"there is no link {name!r}", f"{nearest(name, links)}Valid: {listed(links)}")
        if joint.child in moved:
            first = moved[joint.child]
            problem = f"link {joint.child!r} is moved by joint {first.name!r} (line {first.node.line}) too, which closes a loop"
            joint.node.fail("child", problem, "A URDF is a tree: remove one of the two joints")
        moved[joint.child] = joint
        below.setdefault(joint.parent, []).append(joint)
    roots = [name for name in links if name not in moved]
    if len(roots) > 1:
        problem = f"is moved by no joint, and neither is {roots[0]!r} (line {links[roots[0]].line})"
        links[roots[1]].fail("name", f"link {roots[1]!r} {problem}", 'A robot has one base: join them by <joint type="fixed">')
    if not roots:
        robot.fail("joint", "every link is moved by a joint, so the joints form a loop", "Remove the joint that moves the base")
    tree = Tree(roots[0], links, joints, below)
    reached = {joint.name for joint in tree.walk()}
    for joint in joints.values():
        if joint.name not in reached:
            joint.node.fail("child", f"joint {joint.name!r} is part of a loop that hangs on nothing", "Remove one joint of the loop")
    return tree


@dataclass(frozen=True, slots=True, eq=False)
class Frame:
    """The position (3,) m and the rotation (3, 3) of a frame relative to another frame."""

    position: Array  # (3,) m
    rotation: Array  # (3, 3)

    def __matmul__(self, inner: Frame) -> Frame:
        """Return the frame `inner`, which is relative to this frame, relative to the parent of this frame (product of the poses)."""
        return Frame(self.rotation @ inner.position + self.position, self.rotation @ inner.rotation)


IDENTITY = Frame(np.zeros(3), np.eye(3))


def read_origin(parent: Node) -> Frame:
    """Return the frame in the <origin> of a joint or shape, relative to the frame of its link; the identity if there is no <origin>.

    Raises RobotFileError for faulty numbers.
    """
    node = child(parent, "origin")
    if node is None:
        return IDENTITY
    node.check_attributes({"xyz", "rpy"})
    position = triple(node, "xyz") if "xyz" in node.attributes else np.zeros(3)
    return Frame(position, rotation_of(triple(node, "rpy")) if "rpy" in node.attributes else np.eye(3))


def child(parent: Node, tag: str) -> Node | None:
    """Return the only child element of `parent` with the given tag, or None if there is none; raises RobotFileError if there are two."""
    found = [node for node in parent if node.tag == tag]
    if len(found) > 1:
        found[1].fail("position in the file", f"a second <{tag}>", f"The first is in line {found[0].line}: remove one")
    return found[0] if found else None


def triple(node: Node, name: str) -> Array:
    """Return the three numbers (3,) of an attribute; raises RobotFileError if they are not three, or not from -1e6 to 1e6 (m or rad)."""
    values = np.array(node.numbers(name, 3))
    if float(np.abs(values).max()) > FARTHEST:
        node.fail(name, f"{float(np.abs(values).max()):g} is too large", "URDF counts in metres and radians")
    return values


def bounded(node: Node, name: str, default: float | None = None) -> float:
    """Return the number of an attribute, or `default` if it is absent; raises RobotFileError if its absolute value is above 1e6 (m or rad).

    Without a default the attribute is required.
    """
    value = node.number(name, default)
    if abs(value) > FARTHEST:
        node.fail(name, f"{value:g} is too large", "URDF counts in metres and radians")
    return value


def rotation_of(rpy: Array) -> Array:
    """Return the rotation matrix (3, 3) of `rpy`: roll, pitch, yaw (3,) rad: rotations about the fixed axes x, y and z, in this order."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(rotation: Array) -> Array:
    """Return roll, pitch and yaw (3,) [rad] of a rotation matrix (3, 3).

    The angles give the same matrix also at a pitch of 90 deg, where roll is arbitrary.
    """
    r = rotation
    roll = atan2(r[2, 1], r[2, 2])
    sine, cosine = sin(roll), cos(roll)
    # Without the roll, the rest is a rotation about y and z only, so the yaw compensates for any error of the roll.
    yaw = atan2(sine * r[0, 2] - cosine * r[0, 1], cosine * r[1, 1] - sine * r[1, 2])
    return np.array([roll, atan2(-r[2, 0], hypot(r[0, 0], r[1, 0])), yaw])
