# SPDX-License-Identifier: Apache-2.0
"""Forward kinematics, Jacobians and gravity (thesis 2.3.1, eq. 5.1).

The robot is given in zero-position form: axes and points of all joints in the root frame, every joint at zero (Gupta 1986).
`mobee.model.kinematics` computes the same for many poses at once.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.robot.robot import Joint, Robot

GRAVITY = np.array([0.0, 0.0, -9.81])  # m/s^2, root frame


def joint_positions(robot: Robot, q: Array) -> Array:
    """Return the positions of the joints, (J,) in rad or m, at motor positions q (n,): an affine function of the motors."""
    matrix, offset = robot.coupling
    positions: Array = matrix @ q + offset
    return positions


def cross_matrix(v: Array) -> Array:
    """Return the matrix [v] (3, 3) with [v] w = v x w."""
    return np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])


def rotation(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by an angle a [rad] about a unit axis u (3,): R = I + sin(a) [u] + (1 - cos(a)) [u]^2 (Rodrigues)."""
    turn = cross_matrix(axis)
    turned: Array = np.eye(3) + np.sin(angle) * turn + (1.0 - np.cos(angle)) * turn @ turn
    return turned


def joint_motion(joint: Joint, position: float) -> Array:
    """Return the transform of one joint, (4, 4): a rotation about its axis, x -> R (x - p) + p, or a translation along its axis.

    p: `joint.point`, a point on the axis. `position`: position of the joint, rad or m.
    """
    motion = np.eye(4)
    if joint.kind == "revolute":
        motion[:3, :3] = rotation(joint.axis, position)
        motion[:3, 3] = joint.point - motion[:3, :3] @ joint.point
    else:
        motion[:3, 3] = position * joint.axis
    return motion


def link_frames(robot: Robot, q: Array) -> Array:
    """Return the transforms of all links at the motor positions q (n,) rad, (L, 4, 4), in the root frame.

    The transform of a link moves a point of the link from its place at zero pose to its place at q. It is the product of the transforms
    (`joint_motion`) of the joints from the base to the link; that of the base is the identity.
    """
    frames = [np.eye(4)]  # link 0 is the base
    for joint, position in zip(robot.joints, joint_positions(robot, q), strict=True):
        frames.append(frames[joint.parent] @ joint_motion(joint, position))  # joint j moves link j + 1
    return np.array(frames)


def moved(frame: Array, point: Array) -> Array:
    """Return the point (3,) m that results when the transform `frame` (4, 4) is applied to a point (3,) m."""
    found: Array = frame[:3, :3] @ point + frame[:3, 3]
    return found


def marker_at(robot: Robot, frames: Array, name: str) -> tuple[Array, Array]:
    """Return the position (3,) m and the normal (3,) of the named marker, root frame; `frames`: (L, 4, 4), as from `link_frames`."""
    marker = robot.marker(name)
    frame = frames[marker.link]
    return moved(frame, marker.position), frame[:3, :3] @ marker.normal


def joints_to(robot: Robot, link: int) -> list[int]:
    """Return the indices of the joints between a link (index) and the base, the nearest to the link first."""
    chain = []
    while link > 0:
        chain.append(link - 1)
        link = robot.joints[link - 1].parent
    return chain


def joint_column(robot: Robot, frames: Array, j: int, point: Array) -> Array:
    """Return the column of joint j in the Jacobian (thesis eq. 5.1) of a point that it moves, (6,): linear rows, then angular, root frame.

    `frames`: (L, 4, 4), as from `link_frames`. `point`: (3,) m, root frame, in the pose of `frames`.
    """
    joint, frame = robot.joints[j], frames[j + 1]  # a joint leaves its own axis where it is, so its link carries the axis too
    axis = frame[:3, :3] @ joint.axis
    if joint.kind == "prismatic":
        return np.concatenate([axis, np.zeros(3)])
    return np.concatenate([np.cross(axis, point - moved(frame, joint.point)), axis])


def jacobian(robot: Robot, frames: Array, link: int, point: Array) -> Array:
    """Return the Jacobian J(q) = dx / dq of a point fixed to a link (thesis eq. 5.1), (6, n): linear rows, then angular, root frame.

    `frames`: (L, 4, 4), as from `link_frames`. `link`: index. `point`: (3,) m, root frame, in the pose of `frames`.
    """
    per_joint = np.zeros((6, len(robot.joints)))
    for j in joints_to(robot, link):
        per_joint[:, j] = joint_column(robot, frames, j, point)
    matrix, _ = robot.coupling
    per_motor: Array = per_joint @ matrix
    return per_motor


def marker_jacobian(robot: Robot, q: Array, name: str) -> Array:
    """Return the Jacobian of the named marker at q (n,) rad, (6, n): linear rows [m/rad], then angular, root frame."""
    frames = link_frames(robot, q)
    return jacobian(robot, frames, robot.marker(name).link, marker_at(robot, frames, name)[0])


def weight_torque(robot: Robot, q: Array) -> Array:
    """Return the motor torques that carry the robot's weight at q (n,) rad, (n,) N m: -sum of J^T m g over the masses.

    They are 0 if the robot's file has no masses.
    """
    frames, torque = link_frames(robot, q), np.zeros(len(q))
    for body in robot.bodies:
        centre = moved(frames[body.link], body.centre)
        torque -= jacobian(robot, frames, body.link, centre)[:3].T @ (body.mass * GRAVITY)
    return torque
