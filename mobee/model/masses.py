# SPDX-License-Identifier: Apache-2.0
"""Masses, centres of mass, gravity torques and potential energy of a robot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms, tables
from mobee.robot.robot import Robot, per_robot


@dataclass(frozen=True, slots=True, eq=False)
class Masses:
    """The masses of a robot, for the B links that have one.

    `links`: (B,) indices. `weights`: (B,) kg. `moments`: (B, 4, 1), the mass [kg] times (x, y, z, 1) of its centre [m], root frame, zero
    pose.
    """

    links: Ints
    weights: Array
    moments: Array

    def moved(self, transforms: Array) -> Array:
        """Return mass * centre of mass of each of the B links that have a mass, (..., B, 3) kg m, root frame, in a pose.

        `transforms`: (..., L, 4, 4) of all links in this pose.
        """
        moments: Array = (transforms[..., self.links, :3, :] @ self.moments)[..., 0]
        return moments


@per_robot
def masses(robot: Robot) -> Masses:
    """Return the masses of the robot's links; the arrays have length 0 if the robot's file has no masses."""
    links = np.array([body.link for body in robot.bodies], dtype=np.intp)
    weights = np.array([body.mass for body in robot.bodies])
    centres = np.array([[*body.centre, 1.0] for body in robot.bodies]).reshape(len(links), 4)
    return Masses(links, weights, (weights[:, None] * centres)[..., None])


def centre_of_mass(robot: Robot, transforms: Array) -> Array:
    """Return the centre of mass of the whole robot in a pose, (..., 3) m, root frame; raises InvalidValue if the robot has no masses.

    `transforms`: (..., L, 4, 4) of all links in this pose.
    """
    if not robot.bodies:
        raise InvalidValue(f"{robot.name!r} has no masses (<mass> in its file), so it has no centre of mass.")
    known = masses(robot)
    centre: Array = known.moved(transforms).sum(axis=-2) / known.weights.sum()
    return centre


@per_robot
def centre_of_mass_at_home(robot: Robot) -> Array:
    """Return the centre of mass of the whole robot at home, (3,) m, root frame; raises InvalidValue if the robot has no masses."""
    return centre_of_mass(robot, link_transforms(robot, robot.home))


EARTH = (0.0, 0.0, -9.81)  # m/s^2, root frame


@dataclass(frozen=True, slots=True, eq=False)
class _Carriers:
    """The C joints that carry a mass, with the tables from which gravity torques are computed.

    `joints`: indices of the joints. `carried`: 1 where a joint carries a body (a link's mass), else 0; B bodies. `loads`: mass that each
    joint carries. `frames`: axis and point of each joint at zero pose. `slides`: whether a joint is prismatic. `drives`: joint motion by
    motor motion, of n motors.
    """

    joints: Ints  # (C,)
    carried: Array  # (C, B) 1 where the joint carries the link's mass
    loads: Array  # (C,) kg
    frames: Array  # (C, 4, 2) axis and point of the joints, each with its fourth coordinate
    slides: NDArray[np.bool_]  # (C,)
    drives: Array  # (C, n) joint per motor


def gravity_torque(robot: Robot, q: Array, gravity: ArrayLike = EARTH) -> Array:
    """Return the motor torques [N m] that hold the robot still against its weight, (..., n): the gradient of the potential energy.

    `q`: (..., n) motor positions in rad; `gravity`: (3,) m/s^2 in the root frame. For the motor of a prismatic joint, whose position is
    in m, the value is a force [N]. All are 0 if the robot has no masses. Raises InvalidValue for a wrong shape of q.
    """
    q = _checked(robot, q)
    if not robot.bodies:
        return np.zeros(q.shape)
    m, transforms = _carriers(robot), link_transforms(robot, q)
    carried = m.carried @ masses(robot).moved(transforms)
    frames = transforms[..., m.joints + 1, :3, :] @ m.frames  # a joint leaves its own axis where it is
    axes, points = frames[..., 0], frames[..., 1]
    pull = np.asarray(gravity, dtype=float)
    # g . (axis x lever) = (g x axis) . lever: no cross product with the lever
    turning = ((axes @ _crossed(pull)) * (carried - m.loads[:, None] * points)).sum(axis=-1)
    sliding = (axes @ pull) * m.loads
    torque: Array = -np.where(m.slides, sliding, turning) @ m.drives
    return torque


def potential_energy(robot: Robot, q: Array, gravity: ArrayLike = EARTH) -> Array:
    """Return the potential energy [J] of the robot's masses, (...,); it is 0 for a mass at the origin of the root frame.

    `q`: (..., n) motor positions in rad; `gravity`: (3,) m/s^2 in the root frame. Raises InvalidValue for a wrong shape of q.
    """
    q = _checked(robot, q)
    if not robot.bodies:
        return np.zeros(q.shape[:-1])
    energy: Array = -masses(robot).moved(link_transforms(robot, q)).sum(axis=-2) @ np.asarray(gravity, dtype=float)
    return energy


def _checked(robot: Robot, q: Array) -> Array:
    q, n = real_array("q", q), len(robot.motor_table)
    if q.ndim == 0 or q.shape[-1] != n:
        raise InvalidValue(f"q of shape {q.shape}: must be (..., {n}), a position for every motor of {robot.name}")
    return q


def _crossed(v: Array) -> Array:
    """Return the matrix (3, 3) whose product with rows of axes gives v x axis."""
    return np.array([[0.0, v[2], -v[1]], [-v[2], 0.0, v[0]], [v[1], -v[0], 0.0]])


@per_robot
def _carriers(robot: Robot) -> _Carriers:
    t = tables(robot)
    carried = np.zeros((len(robot.joints), len(robot.bodies)))
    for column, body in enumerate(robot.bodies):
        carried[t.ancestry[body.link], column] = 1.0
    joints = np.flatnonzero(carried.any(axis=1))
    frames = np.zeros((len(joints), 4, 2))
    frames[:, :3, 0], frames[:, :3, 1], frames[:, 3, 1] = t.axes[joints], t.points[joints], 1.0
    return _Carriers(
        joints=joints,
        carried=carried[joints],
        loads=carried[joints] @ masses(robot).weights,
        frames=frames,
        slides=t.revolute[joints] == 0.0,
        drives=np.ascontiguousarray(t.coupling[:, joints].T),
    )
