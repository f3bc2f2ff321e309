"""The dynamical system of eq. 5.7: the sum of its forces, one step, and the command.

A force of your own is a function of the `State`; put it behind the others and give the list to `acceleration`, or to
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
from mobee.reference.forces import State, clause_force, config_force, contact_force, damping, limit_force, spring, work_force
from mobee.reference.kinematics import weight_torque
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot

Term = Callable[[State], Array]  # a force, (n,) rad/s^2

TERMS: tuple[Term, ...] = (spring, damping, config_force, work_force, limit_force, clause_force, contact_force)

INSIDE = 0.999  # of the motors' velocity and acceleration: rounding on the way is not to make the safety gate refuse
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a motor that something blocks


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Where the dynamical system is; arrays (n,)."""

    velocity: Array  # rad/s, its own
    acceleration: Array  # rad/s^2, of what was sent
    sent: Array  # rad/s, commanded last: the own velocity, but for a part just put in hold
    reference: Array  # rad, the position command


def acceleration(state: State, terms: Sequence[Term] = TERMS) -> Array:
    """Eq. 5.7 with mass 1, solved for q'': the sum of the terms, (n,) rad/s^2."""
    total = np.zeros(len(state.q))
    for term in terms:
        total += term(state)
    return total


def at_rest(robot: Robot, gains: Gains, q: Array) -> Motion:
    """At rest at the measured q (n,) rad; the reference of a motor that is never moved is within its limits."""
    still = np.zeros(len(q))
    return Motion(still, still, still, np.where(gains.weight(robot.motors) > 0, q, np.clip(q, *robot.limits.T)))


def step(robot: Robot, gains: Gains, motion: Motion, q: Array, wanted: Array, dt: float, speed_scale: float = 1.0) -> Motion:
    """One step by dt [s], semi-implicit: velocity, then position, from the measured q and the acceleration that is wanted, (n,).

    The motors' limits of velocity (times `speed_scale`) and acceleration hold for what is sent.  The position reference integrates
    the velocity, but waits where it is `LEASH` ahead of the motor.  Motors of weight 0 are never moved.
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
    """A part's own velocity is 0 from now on; what is sent follows as fast as the acceleration limit lets it."""
    stopped = np.zeros(len(motion.velocity), dtype=bool)
    stopped[robot.part(part).slice] = True
    return replace(motion, velocity=np.where(stopped, 0.0, motion.velocity), acceleration=np.where(stopped, 0.0, motion.acceleration))


def torque(robot: Robot, motion: Motion, q: Array) -> Array:
    """The torque command (n,) N m: what gives a motor its velocity and acceleration, and what carries the weight at q (n,) rad."""
    most = np.array([motor.max_torque for motor in robot.motor_table])
    wanted = INERTIA * motion.acceleration + FRICTION * motion.velocity + weight_torque(robot, q)
    return np.clip(wanted, -most, most)


def is_settled(robot: Robot, gains: Gains, motion: Motion, part: str) -> bool:
    """Whether a part is at rest (thesis 6.1): every motor commanded at most the settle speed and acceleration.

    It is looked at `first_look` s after the action began, then every `interval` s, up to `timeout`.
    """
    where, unit = robot.part(part).slice, fine_units(robot)
    slow = np.abs(motion.velocity) <= gains.settle.speed * unit
    calm = np.abs(motion.acceleration) <= gains.settle.acceleration * unit
    return bool((slow & calm)[where].all())
