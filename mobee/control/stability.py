# SPDX-License-Identifier: Apache-2.0
"""The largest time step at which the control law is stable."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.control.law import stack_clauses
from mobee.errors import InvalidValue
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest stable time step of the control law, and the combined motion of motors that becomes unstable first.

    `step`: s. `motor`: name of the motor with the largest share of that motion. `damping` [1/s], `stiffness` [1/s^2]: of the law along
    that motion.
    """

    step: float
    motor: str
    damping: float
    stiffness: float


def largest_step(robot: Robot, gains: Gains) -> float:
    """Return the time step [s] below which the semi-implicit Euler step of the control law is stable; infinite if no motor moves."""
    return stability_bound(robot, gains).step


def require_stable(robot: Robot, gains: Gains, dt: float) -> None:
    """Raise InvalidValue, with motor and violated bound, if the control law is unstable at steps of dt [s], or if dt is not valid."""
    if not (dt > 0 and np.isfinite(dt)):
        raise InvalidValue(f"time step {dt} s: must be a finite time above 0")
    bound = stability_bound(robot, gains)
    if dt < bound.step:
        return
    c, k = bound.damping, bound.stiffness
    broken = (
        f"damping * dt = {c * dt:.3g}, must be below 2"
        if c * dt >= 2
        else f"stiffness * dt^2 = {k * dt * dt:.3g} with limits and clauses, must be below 4 - 2 damping dt = {4 - 2 * c * dt:.3g}"
    )
    raise InvalidValue(
        f"gains unstable at steps of {dt:.4g} s: at {bound.motor}, {broken}. Use steps below {bound.step:.4g} s or less damping."
    )


@lru_cache(maxsize=8)
def stability_bound(robot: Robot, gains: Gains) -> Bound:
    """Return the largest stable time step for the worst case: all springs have their largest stiffness at the same time.

    The springs pull the motors to the attractor (the goal position), and push them away from the joint limits and into the region allowed
    by the clauses (conditions on motor positions). C is the diagonal damping [1/s] and K the stiffness [1/s^2] of all motors. A step of dt
    is stable while 4 - 2 dt C - dt^2 K is positive definite. So the largest stable step is 1/s, where s is the largest number for which
    4 s^2 - 2 s C - K is singular. Two effects are not included; docs/law.md has numbers for both. Contacts: their stiffness depends on the
    pose and on their number, and their force is bounded. Delays of commands: their effect depends on the motors.
    """
    moved = np.flatnonzero(gains.weight(robot.motors) > 0)
    if not len(moved):
        return Bound(np.inf, "no motor", 0.0, 0.0)
    damping = gains.of_robot("damping", robot)[moved]
    stiffness = _stiffness(robot, gains)[np.ix_(moved, moved)]
    one = np.eye(len(moved))
    values, vectors = np.linalg.eig(np.block([[np.diag(damping) / 2.0, stiffness / 4.0], [one, 0.0 * one]]))
    most = int(values.real.argmax())
    motion = vectors[len(moved) :, most].real
    motion = motion / np.linalg.norm(motion)
    motor = robot.motors[moved[int(np.abs(motion).argmax())]]
    return Bound(float(1.0 / values[most].real), motor, float(damping @ motion**2), float(motion @ stiffness @ motion))


def _stiffness(robot: Robot, gains: Gains) -> Array:
    """Return the stiffness of all springs at their steepest, each motor in its unit of `motor_units`, symmetric, (n, n) in 1/s^2."""
    single = gains.of_robot("stiffness", robot) + gains.of_robot("max_limit", robot) / gains.of_robot("limit_width", robot)
    rows = stack_clauses([replace(clause, a=clause.a * motor_units(robot)) for clause in robot.clauses], len(robot.motors))
    slope = gains.max_constraint / gains.constraint_width
    if gains.law == "published_2014":
        steep = slope * rows.norms
    else:  # one row sets the size of the push along all rows of a clause: at most sqrt(number of rows) times as stiff as that row
        steep = slope * np.sqrt(np.bincount(rows.clause))[rows.clause] if len(rows.b) else rows.norms
    found: Array = np.diag(single) + (rows.normals.T * steep) @ rows.normals
    return found
