# SPDX-License-Identifier: Apache-2.0
"""Chooses the joints of an arm that move its end most, and limits motors with a range of more than a turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from mobee.arrays import Array
from mobee.derivation.chains import Chain, end_point
from mobee.model.kinematics import link_transforms
from mobee.robot.motor_units import slides
from mobee.robot.robot import Motor, Robot

MOST_JOINTS = 4  # of one arm: 3 levels of each make 81 states
LEAST_SHARE = 0.1  # of the movement of the best joint: one that moves the end less is left out
POSES, LEVELS = 16, 5  # random poses, and places in the range of the joint, over which movement is measured
TURN = 2.0 * np.pi


def bounded(robot: Robot) -> tuple[Robot, list[str]]:
    """Limit every motor that can turn a joint by more than a turn to one turn; return the robot and the names of the changed motors.

    With a larger range, positions one turn apart are the same pose, so that several states of a lattice would be the same pose. For a motor
    that drives joints with other scales than 1, the turn is that of the joint that moves most. The middle of the new range is 0, or home if
    home is more than half a turn from 0. If the new range would exceed the old limits, it is shifted into them.
    """
    table = []
    for motor in robot.motor_table:
        scale = max((abs(scale) for _, scale, _ in motor.joints), default=1.0)
        if np.ptp(motor.limits) * scale >= TURN - 1e-6 and not slides(robot, motor):
            centre = motor.home if abs(motor.home) > np.pi / scale else 0.0
            low, high = motor.limits
            centre = float(np.clip(centre, low + np.pi / scale, max(high - np.pi / scale, low + np.pi / scale)))
            limits = np.clip(centre + np.array([-np.pi, np.pi]) / scale, low, high)
            motor = replace(motor, limits=limits, home=float(np.clip(motor.home, *limits)))
        table.append(motor)
    narrowed = [name for name, one, other in zip(robot.motors, robot.motor_table, table, strict=True) if np.any(one.limits != other.limits)]
    return _with_motors(robot, table), narrowed


def with_limits(robot: Robot, limits: Mapping[int, Array]) -> Robot:
    """Return a copy of the robot with new limits of some motors.

    The home position of each of these motors is clipped to its new limits, and the limits of the joints that it drives are computed again
    from them. `limits`: dict from the index of a motor to its lowest and highest position (2,), in the unit of the motor, rad or m.
    """
    table = [
        replace(motor, limits=limits[k], home=float(np.clip(motor.home, *limits[k]))) if k in limits else motor
        for k, motor in enumerate(robot.motor_table)
    ]
    return _with_motors(robot, table)


def _with_motors(robot: Robot, table: Sequence[Motor]) -> Robot:
    """Return the robot with other motors, and with the limits of its joints that follow from these."""
    moved = {j: np.sort(scale * motor.limits + shift) for motor in table for j, scale, shift in motor.joints}
    joints = tuple(replace(joint, limits=moved.get(index, joint.limits)) for index, joint in enumerate(robot.joints))
    return replace(robot, joints=joints, motor_table=tuple(table))


def movements(robot: Robot, chain: Chain, motors: Sequence[int], seed: int) -> Array:
    """Return how far each motor moves the end of a chain over the motor's range, (k,) m: the mean over random poses of the other motors.

    `motors`: indices of the k motors. `seed`: seed of the random poses.
    """
    low, high = robot.limits.T
    point = end_point(robot, chain)
    poses = np.random.default_rng(seed).uniform(low, high, (POSES, len(low)))
    found = np.zeros(len(motors))
    for number, motor in enumerate(motors):
        q = np.repeat(poses[:, None], LEVELS, axis=1)
        q[:, :, motor] = np.linspace(low[motor], high[motor], LEVELS)
        transforms = link_transforms(robot, q)[..., chain.end, :, :]
        places = transforms[..., :3, :3] @ point + transforms[..., :3, 3]  # (POSES, LEVELS, 3)
        apart = np.linalg.norm(places[:, :, None] - places[:, None], axis=-1)
        found[number] = apart.max(axis=(1, 2)).mean()
    return found


def joints_to_learn(robot: Robot, motors: Sequence[int], moved: Array) -> tuple[str, ...]:
    """Return the names of the motors that move the end of an arm most, at most MOST_JOINTS (4), in the order of `motors`.

    `motors`: indices of the k motors of the arm. `moved`: (k,) m, how far each motor moves the end; motors below 10 % of the largest value
    are left out.
    """
    best = [k for k in np.argsort(-moved, kind="stable")[:MOST_JOINTS] if moved[k] >= LEAST_SHARE * moved.max()]
    return tuple(robot.motors[motors[k]] for k in sorted(best))
