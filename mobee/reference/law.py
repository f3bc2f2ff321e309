# SPDX-License-Identifier: Apache-2.0
"""The dynamical system of thesis eq. 5.7: M q" + C q' + L(K (q - q*)) = f_config + f_work + f_lim + f_cst + f_coll.

This file has the sum of the forces, one step of the system, and the command. The forces themselves are in `forces`.

A new force is a function of the `State`. Append it to the others, and pass the list to `acceleration`, or to
`mobee.reference.plant.Plant`:

    def viscous(s: State) -> Array:
        return -5000.0 * max((c.depth for c in s.contacts if c.kind == "field"), default=0.0) * s.velocity

    acceleration(state, (*TERMS, viscous))
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.control.law import FRICTION, INERTIA
from mobee.reference.forces import (
    State,
    clause_force,
    config_force,
    contact_force,
    damping,
    following,
    limit_force,
    spring,
    work_force,
)
from mobee.reference.kinematics import weight_torque
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot

Term = Callable[[State], Array]  # a force, (n,) rad/s^2

TERMS: tuple[Term, ...] = (spring, damping, config_force, work_force, limit_force, clause_force, contact_force)

INSIDE = 0.999  # share of the motors' velocity and acceleration limits, so that no rounding makes the safety gate refuse a command
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a blocked motor


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """The state of the dynamical system; arrays (n,) in the order of `robot.motors`.

    `velocity`: rad/s, the system's own q'. `acceleration`: rad/s^2, of the commanded velocity. `sent`: rad/s, the velocity that was
    commanded last; it differs from `velocity` only for a part that was just put in hold (stands still, follows no commands). `reference`:
    rad, the position command.
    """

    velocity: Array
    acceleration: Array
    sent: Array
    reference: Array


def acceleration(state: State, terms: Sequence[Term] = TERMS) -> Array:
    """Return q" of eq. 5.7 with mass 1, (n,) rad/s^2: the sum of all terms, plus C q*' for an attractor that moves.

    C is the damping gain, q*' the velocity of the attractor (the pose to which the spring pulls the motors). `terms`: the forces, each a
    function of the state. All forces except `spring` and `damping` are summed: for a motor whose sum opposes q*', `following` reduces
    C q*'. A copy or a wrapper of `spring` or `damping` would be counted in this sum, so do not use one.
    """
    total, outside = np.zeros(len(state.q)), np.zeros(len(state.q))
    for term in terms:
        force = term(state)
        total += force
        if term not in (spring, damping):
            outside += force
    return total + following(state, outside)


def at_rest(robot: Robot, gains: Gains, q: Array) -> Motion:
    """Return the state of the dynamical system at rest at the measured q (n,) rad.

    The position reference is q; for a motor with weight 0 in the gains, which the control law never moves, it is q clipped to the motor's
    limits.
    """
    still = np.zeros(len(q))
    return Motion(still, still, still, np.where(gains.weight(robot.motors) > 0, q, np.clip(q, *robot.limits.T)))


def step(robot: Robot, gains: Gains, motion: Motion, q: Array, wanted: Array, dt: float, speed_scale: float = 1.0) -> Motion:
    """Advance the dynamical system by dt [s], semi-implicitly (first the velocity, then the position), and return the new state.

    `q` (n,) rad: measured. `wanted` (n,) rad/s^2: q" of eq. 5.7. The commanded velocity stays within the motors' limits of velocity (times
    `speed_scale`) and acceleration. The position reference integrates the velocity. It stops when it is ahead of the measured position by
    more than the distance that the motor moves in LEASH (0.3 s) at full speed. Motors of weight 0 in the gains are never moved.
    """
    fastest = INSIDE * speed_scale * np.array([motor.max_velocity for motor in robot.motor_table])
    hardest = INSIDE * np.array([motor.max_acceleration for motor in robot.motor_table])
    low, high = robot.limits.T
    change = np.clip(motion.velocity + wanted * dt, -fastest, fastest) - motion.sent
    velocity = motion.sent + np.clip(change, -hardest * dt, hardest * dt)
    lead = motion.reference - q
    waits = (np.abs(lead) > LEASH * fastest) & (lead * velocity > 0.0)
    reference = np.clip(motion.reference + np.where(waits, 0.0, velocity * dt), low, high)
    moved = gains.weight(robot.motors) > 0
    return Motion(
        velocity=np.where(moved, velocity, motion.velocity),
        acceleration=np.where(moved, (velocity - motion.sent) / dt, motion.acceleration),
        sent=np.where(moved, velocity, motion.sent),
        reference=np.where(moved, reference, motion.reference),
    )


def hold(robot: Robot, motion: Motion, part: str) -> Motion:
    """Return the state after the part is put in hold (it stands still): its velocity and acceleration are 0.

    The commanded velocity (`sent`) is not changed here; in later steps it decreases as fast as the acceleration limit allows.
    """
    stopped = np.zeros(len(motion.velocity), dtype=bool)
    stopped[robot.part(part).slice] = True
    return replace(motion, velocity=np.where(stopped, 0.0, motion.velocity), acceleration=np.where(stopped, 0.0, motion.acceleration))


def torque(robot: Robot, motion: Motion, q: Array) -> Array:
    """Return the torque command, (n,) N m (N for a slide): the sum of the torques for acceleration, viscous friction and weight.

    The acceleration and the velocity are those of `motion`; the weight is that of the robot at q (n,) rad. The sum is clipped to the
    largest torque of each motor.
    """
    most = np.array([motor.max_torque for motor in robot.motor_table])
    wanted = INERTIA * motion.acceleration + FRICTION * motion.velocity + weight_torque(robot, q)
    return np.clip(wanted, -most, most)


def is_settled(robot: Robot, gains: Gains, motion: Motion, part: str) -> bool:
    """Return whether a part has settled (thesis 6.1): its motors have small commanded velocities and accelerations.

    The velocity of each must be at most `gains.settle.speed`, and the acceleration at most `gains.settle.acceleration`. For a motor that
    slides, both bounds are multiplied by its number in `mobee.robot.motor_units.fine_units` (m per rad). The caller calls this function
    `gains.settle.first_check` s after the action began, then every `interval` s, until `timeout` s.
    """
    where, unit = robot.part(part).slice, fine_units(robot)
    slow = np.abs(motion.velocity) <= gains.settle.speed * unit
    calm = np.abs(motion.acceleration) <= gains.settle.acceleration * unit
    return bool((slow & calm)[where].all())
