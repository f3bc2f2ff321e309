"""Jacobians of points that move with a link, per motor (thesis eq. 5.1)."""

from __future__ import annotations

import numpy as np

from mobee.kinematics.tables import tables
from mobee.kinematics.vectors import cross
from mobee.robot.robot import Array, Ints, Robot


def joint_axes(robot: Robot, transforms: Array) -> tuple[Array, Array]:
    """The joints' axes and points now, root frame: two arrays (..., J, 3), unit and m, from (..., L, 4, 4)."""
    return _moved_axes(robot, transforms, np.arange(len(robot.joints)))


def point_jacobian(robot: Robot, transforms: Array, link: int, point: Array) -> Array:
    """How a point fixed to a link moves with each motor.

    `transforms`: (..., L, 4, 4); `point`: (..., 3) m in the root frame now.
    Returns (..., 6, n): three rows of velocity [m/rad], then three of angular velocity, root frame.
    """
    t = tables(robot)
    chain = t.ancestry[link]
    axes, points = _moved_axes(robot, transforms, chain)
    revolute = t.revolute[chain, None]
    arms = point[..., None, :] - points
    per_joint = np.empty((*axes.shape[:-1], 6))
    per_joint[..., :3] = revolute * cross(axes, arms) + (1.0 - revolute) * axes
    per_joint[..., 3:] = revolute * axes
    return np.swapaxes(per_joint, -1, -2) @ t.coupling[:, chain].T


def _moved_axes(robot: Robot, transforms: Array, joints: Ints) -> tuple[Array, Array]:
    # A joint leaves its own axis where it is, so the link it moves carries the axis too.
    t = tables(robot)
    moved = transforms[..., joints + 1, :3, :]
    axes = (moved[..., :3] @ t.axes[joints, :, None])[..., 0]
    points = (moved[..., :3] @ t.points[joints, :, None])[..., 0] + moved[..., 3]
    return axes, points
