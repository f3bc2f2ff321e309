"""The tags sphere, capsule, cylinder and box: one grammar for robots and worlds (thesis 2.3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.robot.robot import Array, ShapeKind
from mobee.robot.xml_node import Node

PLACE = ("px", "py", "pz")
AXIS = ("hx", "hy", "hz")
Y = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])
VOLUME_TAGS: dict[str, frozenset[str]] = {
    "sphere": frozenset({"radius", *PLACE}),
    "capsule": frozenset({"radius", "height", *PLACE, *AXIS}),
    "cylinder": frozenset({"radius", "height", *PLACE, *AXIS}),
    "box": frozenset({"width", "height", "depth", "angle", *PLACE, *AXIS}),
}
KINDS: dict[str, ShapeKind] = {"sphere": "sphere", "capsule": "capsule", "cylinder": "cylinder", "box": "box"}


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """Kind, size and vertices as in mobee.robot.robot.Shape, centre (3,) m and orientation (3, 3), relative to its parent point."""

    kind: ShapeKind
    size: tuple[float, ...]
    centre: Array
    rotation: Array
    vertices: Array | None = None


def read_volume(node: Node) -> Volume:
    """The volume of a <sphere>, <capsule>, <cylinder> or <box>; raises RobotFileError."""
    centre = node.vector(PLACE)
    kind = KINDS[node.tag]
    if kind == "sphere":
        return Volume(kind, (node.positive("radius"),), centre, np.eye(3))
    if kind == "box":
        size = (node.positive("width"), node.positive("height"), node.positive("depth"))
        return Volume(kind, size, centre, box_rotation(node))
    axis = direction(node, AXIS, (0.0, 1.0, 0.0))
    return Volume(kind, (node.positive("radius"), node.positive("height")), centre, align(Z, axis))


def box_rotation(node: Node) -> Array:
    """The orientation (3, 3) that turns y the shortest way to (hx, hy, hz), then by `angle` [deg] about it."""
    axis = direction(node, AXIS, (0.0, 1.0, 0.0))
    return turn_about(axis, np.deg2rad(node.number("angle", 0.0))) @ align(Y, axis)


def direction(node: Node, names: tuple[str, str, str], default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """A unit vector along three attributes; raises RobotFileError when it has no length."""
    vector = node.vector(names, default)
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        node.fail(" ".join(names), "the direction has no length", f"Give at least one of {', '.join(names)} a value other than 0")
    return vector / length


def align(source: Array, target: Array) -> Array:
    """The smallest rotation (3, 3) that takes one unit vector to another; half a turn about x (or z) when they are opposite."""
    cosine = float(source @ target)
    if cosine < -0.9:  # the division below would lose all but the first digits
        axis = np.cross(source, target)
        sine = float(np.linalg.norm(axis))
        if sine < 1e-12:
            return turn_about(np.array([1.0, 0.0, 0.0]) if abs(source[0]) < 0.5 else Z, np.pi)
        return turn_about(axis / sine, np.arctan2(sine, cosine))
    cross = skew(np.cross(source, target))
    return np.eye(3) + cross + cross @ cross / (1 + cosine)


def turn_about(axis: Array, angle: float) -> Array:
    """The rotation (3, 3) about a unit axis by an angle in [rad]."""
    cross = skew(axis)
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def skew(v: Array) -> Array:
    """The matrix (3, 3) of the cross product with v."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
