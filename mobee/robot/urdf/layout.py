# SPDX-License-Identifier: Apache-2.0
"""A URDF's tree laid out at zero pose: links, joints, markers and masses in the root frame."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.robot.bodies import from_six, one_a_link
from mobee.robot.robot import Body, Joint, Marker
from mobee.robot.urdf.motors import stated_limits
from mobee.robot.urdf.tree import IDENTITY, Frame, Tree, UrdfJoint, bounded, check_spelling, child, read_origin, triple
from mobee.robot.xml.node import SMALLEST, Node
from mobee.robot.xml.volume import Z, turn_about


@dataclass(slots=True, eq=False)
class Skeleton:
    """The tree of a URDF at zero pose; the links of fixed joints are merged into the links that carry them.

    `links`: names of the robot's links. `index`: dict from the name of a URDF link to the index of the robot's link. `frames`: dict from
    the name of a URDF link to its frame in the root frame. `joints`: the robot's joints. `moving`: for each of these joints, the joint of
    the URDF from which it was made. `marked`: names of the URDF links that become markers.
    """

    links: list[str]
    index: dict[str, int]
    frames: dict[str, Frame]
    joints: list[Joint] = field(default_factory=list)
    moving: list[UrdfJoint] = field(default_factory=list)
    marked: list[str] = field(default_factory=list)


def lay_out(tree: Tree) -> Skeleton:
    """Return the links and joints of a URDF with their frames at zero pose, in the root frame.

    The child link of a fixed joint, or of a joint without <mimic> whose lower and upper limits are equal, is merged into the parent
    link.
    """
    skeleton = Skeleton([tree.root], {tree.root: 0}, {tree.root: IDENTITY})
    for joint in tree.walk():
        frame = skeleton.frames[joint.parent] @ joint.origin
        parent = skeleton.index[joint.parent]
        held = IDENTITY if joint.kind == "fixed" else _locked(joint)
        if held is not None:
            skeleton.frames[joint.child] = frame @ held
            skeleton.index[joint.child] = parent
            skeleton.marked.append(joint.child)
            continue
        axis = frame.rotation @ joint.axis
        kind: Literal["revolute", "prismatic"] = "prismatic" if joint.kind == "prismatic" else "revolute"
        skeleton.joints.append(Joint(joint.name, parent, kind, axis / np.linalg.norm(axis), frame.position, np.zeros(2)))
        skeleton.moving.append(joint)
        skeleton.links.append(joint.child)
        skeleton.frames[joint.child] = frame
        skeleton.index[joint.child] = len(skeleton.joints)
        if joint.child not in tree.below:
            skeleton.marked.append(joint.child)
    return skeleton


def _locked(joint: UrdfJoint) -> Frame | None:
    """Return the fixed pose of a joint whose lower and upper limits are equal; None for a joint that can move."""
    if child(joint.node, "mimic") is not None or child(joint.node, "limit") is None:
        return None
    low, high = stated_limits(joint)
    if high > low:
        return None
    joint.node.warn(f"joint {joint.name!r} has lower = upper = {low:g}, so it is fixed there")
    return Frame(low * joint.axis, np.eye(3)) if joint.kind == "prismatic" else Frame(np.zeros(3), turn_about(joint.axis, low))


def read_markers(tree: Tree, skeleton: Skeleton, where: dict[tuple[str, str], str]) -> Iterator[Marker]:
    """Yield a marker (a named point with a normal) at the frame of each URDF link in `skeleton.marked`.

    These are the links that a fixed joint, or a joint whose lower and upper limits are equal, attaches, and the links without child links.
    File and line of each marker are added to `where`, as ("marker", name) -> "file:line".
    """
    notes = {link: note for link in skeleton.marked for note in tree.links[link] if note.tag == "mobee" and "marker" in note.attributes}
    taken: set[str] = set()
    for link in sorted(skeleton.marked, key=lambda name: name not in notes):  # names that write_urdf noted come first
        node, frame = notes.get(link, tree.links[link]), skeleton.frames[link]
        name = node.text("marker") if link in notes else link
        if name in taken and link in notes:
            node.fail("marker", f"a second marker {name!r}", "Rename one of the two")
        if name in taken:
            continue
        taken.add(name)
        where["marker", name] = f"{node.file}:{node.line}"
        normal = frame.rotation @ (_normal(node) if link in notes else Z)
        yield Marker(name, skeleton.index[link], frame.position, frame.rotation, normal)


def _normal(note: Node) -> Array:
    """Return the normal that `write_urdf` noted, in the link's frame; z if there is none."""
    if "normal" not in note.attributes:
        return Z
    normal = triple(note, "normal")
    length = float(np.linalg.norm(normal))
    if length < 1e-9:
        note.fail("normal", "has no length", "Write a direction in the link's frame, such as 0 0 1")
    return normal / length


SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")  # of a symmetric matrix


def read_bodies(tree: Tree, skeleton: Skeleton) -> tuple[Body, ...]:
    """Return the bodies of the robot: one for each link that has a mass. Raises RobotFileError for faulty numbers.

    A link on a fixed joint gets no body; its mass is added to the body of the link that carries it.
    """
    return one_a_link(_bodies(tree, skeleton))


def _bodies(tree: Tree, skeleton: Skeleton) -> Iterator[Body]:
    for name, link in skeleton.index.items():
        inertial = child(tree.links[name], "inertial")
        mass = None if inertial is None else child(inertial, "mass")
        if inertial is None or mass is None:
            continue
        value = bounded(mass, "value")
        if value < 0:
            mass.fail("value", f"{value:g} is negative", "Write the mass in kilograms, or leave <inertial> out")
        if value >= SMALLEST:  # exporters write 0 for frames
            place = skeleton.frames[name] @ read_origin(inertial)
            yield Body(link, value, place.position, _inertia(inertial, place))


def _inertia(inertial: Node, place: Frame) -> Array | None:
    """Return the inertia (3, 3) about the centre of mass, along the root frame's axes; None where the file has none."""
    node, note = child(inertial, "inertia"), child(inertial, "mobee")
    if node is None or (note is not None and note.flag("assumed")):
        return None
    check_spelling(node, SIX)
    inertia = place.rotation @ from_six([bounded(node, name, 0.0) for name in SIX]) @ place.rotation.T
    return inertia if inertia.any() else None
