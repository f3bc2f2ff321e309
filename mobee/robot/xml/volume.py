# SPDX-License-Identifier: Apache-2.0
"""Reads the tags sphere, capsule, cylinder and box, of robots and worlds (thesis 2.3.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import ShapeKind
from mobee.robot.xml.node import Node

PLACE = ("px", "py", "pz")
AXIS = ("hx", "hy", "hz")
STEP = ("x", "y", "z")
X = np.array([1.0, 0.0, 0.0])
Y = np.array([0.0, 1.0, 0.0])
Z = np.array([0.0, 0.0, 1.0])
UPRIGHT = 1e-6  # a unit vector with a smaller part across y counts as parallel to y, as in the program of 2014
HALFWAY = -0.5  # cosine; beyond it a box is written with its axis the other way round, for near -y the rotation is ill-defined
VOLUME_TAGS: dict[str, frozenset[str]] = {
    "sphere": frozenset({"radius", *PLACE}),
    "capsule": frozenset({"radius", "height", *PLACE, *AXIS}),
    "cylinder": frozenset({"radius", "height", *PLACE, *AXIS}),
    "box": frozenset({"width", "height", "depth", "angle", *PLACE, *AXIS}),
}
KINDS: dict[str, ShapeKind] = {"sphere": "sphere", "capsule": "capsule", "cylinder": "cylinder", "box": "box"}


@dataclass(frozen=True, slots=True, eq=False)
class Volume:
    """A volume as a file describes it.

    `kind`: "sphere", "capsule", "cylinder", "box" or "convex". `size` in m, as in `mobee.robot.robot.Shape`: sphere (radius,); capsule and
    cylinder (radius, height); box (x, y, z), full edges; convex (). `vertices`: (v, 3) m, corners of a convex volume in its
    own frame, which has its origin at `centre`; None for the other kinds. `centre` (3,) m: relative to the start of the link or joint that
    contains the volume, along the axes of the root frame; of a world object: in the root frame. `rotation` (3, 3): from the volume's own
    frame to the axes of the root frame.
    """

    kind: ShapeKind
    size: tuple[float, ...]
    centre: Array
    rotation: Array
    vertices: Array | None = None


def read_volume(node: Node) -> Volume:
    """Return the volume that a <sphere>, <capsule>, <cylinder> or <box> element describes; raises RobotFileError if it is not valid."""
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
    """Return the rotation (3, 3) that a <box> or <convex> element describes.

    The height of the box (its y axis) is along (hx, hy, hz), or along y if these are absent. The attribute `angle` [deg], 0 if absent, is
    the box's rotation about its height. `height_along` defines which rotation has the angle 0.
    """
    return height_along(direction(node, AXIS, (0.0, 1.0, 0.0)), np.deg2rad(node.number("angle", 0.0)))


def height_along(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) of a box with its height (y axis) along the unit vector `axis` (3,), as MoBeE computed it in 2014.

    The box first turns about y by the angle between x and the projection of the axis onto the xz plane (0 to 180 deg). Then it turns about
    the common normal of y and the axis until its height is along the axis. Last it turns by `angle` [rad] about the axis. For an axis
    along -y the first two rotations are replaced by half a turn about x.
    """
    sideways = float(np.hypot(axis[0], axis[2]))
    if sideways <= UPRIGHT:
        return turn_about(axis, angle) @ align(Y, axis)
    first = turn_about(Y, float(np.arctan2(abs(axis[2]), axis[0])))
    tilt = turn_about(np.cross(Y, axis) / sideways, float(np.arctan2(sideways, axis[1])))
    return turn_about(axis, angle) @ tilt @ first


def height_and_angle(rotation: Array) -> tuple[Array, float]:
    """Return the height axis (unit vector (3,)) of a box with the rotation (3, 3), and its angle [rad] about this axis.

    They are the arguments with which `height_along` returns the same rotation. If the height axis is more than 120 deg from y, the result
    is for the box after half a turn about its own x axis, which does not change the box.
    """
    if rotation[1, 1] < HALFWAY:
        rotation = rotation * np.array([1.0, -1.0, -1.0])  # the same box
    axis: Array = rotation[:, 1]
    return axis, angle_about(axis, rotation)


def angle_about(axis: Array, rotation: Array) -> float:
    """Return the angle [rad] about a box's height axis, unit vector `axis` (3,), that fits the rotation (3, 3) of the box best.

    At this angle the rotation `height_along(axis, angle)` is nearest to `rotation`.
    """
    rest = height_along(axis, 0.0).T @ rotation
    return float(np.arctan2(rest[0, 2] - rest[2, 0], rest[0, 0] + rest[2, 2]))


def link_step(node: Node) -> tuple[Array, float]:
    """Return the vector (3,) m from start to end of a <link> element, and its length [m].

    The vector is (x, y, z) of the element; with the attribute `length` it is scaled to this length.
    """
    step = node.vector(STEP)
    if "length" in node.attributes:
        length = node.positive("length")
        return direction(node, STEP) * length, length
    return step, float(np.linalg.norm(step))


def direction(node: Node, names: tuple[str, str, str], default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
    """Return the unit vector (3,) along the vector in the three attributes `names`, or along `default` if all three are absent.

    Raises RobotFileError if the vector is 0.
    """
    vector = node.vector(names, default)
    length = float(np.linalg.norm(vector))
    if length < 1e-9:
        node.fail(" ".join(names), "the direction has no length", f"Give at least one of {', '.join(names)} a value other than 0")
    return vector / length


def align(source: Array, target: Array) -> Array:
    """Return the smallest rotation (3, 3) that turns the unit vector `source` (3,) to the unit vector `target` (3,).

    For opposite vectors it is half a turn about x, or about z if the absolute x component of `source` is 0.5 or more. Such a half turn
    leads to `target` only if `source` is perpendicular to its axis; for other opposite vectors the result is wrong.
    """
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
    """Return the rotation (3, 3) about the unit vector `axis` (3,) by `angle` [rad]."""
    cross = skew(axis)
    turn: Array = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turn


def skew(v: Array) -> Array:
    """Return the matrix (3, 3) whose product with a vector w is the cross product of v (3,) and w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
