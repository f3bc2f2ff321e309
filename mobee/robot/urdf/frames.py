# SPDX-License-Identifier: Apache-2.0
"""Frames of URDF: `<origin xyz=... rpy=...>`, rotations about the fixed axes x, y, z in that order."""

from __future__ import annotations

from dataclasses import dataclass
from math import atan2, cos, hypot, sin

import numpy as np

from mobee.arrays import Array
from mobee.robot.xml.node import Node

FARTHEST = 1e6  # m: a larger number is a mistake, and the arithmetic would lose millimetres


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
    """Return the three numbers (3,) of an attribute; raises RobotFileError if they are not three, or one is above 1e6 (m or rad)."""
    values = np.array(node.numbers(name, 3))
    if float(np.abs(values).max()) > FARTHEST:
        node.fail(name, f"{float(np.abs(values).max()):g} is too large", "URDF counts in metres and radians")
    return values


def bounded(node: Node, name: str, default: float | None = None) -> float:
    """Return the number of an attribute, or `default` if it is absent; raises RobotFileError if it is above 1e6 (m or rad).

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
