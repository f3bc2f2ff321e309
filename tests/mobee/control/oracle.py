"""The control law in numpy, formula by formula: what the compiled law is compared with."""

from __future__ import annotations

import numpy as np

from mobee.control import Forces, Gains
from mobee.control.clauses import stack_clauses
from mobee.control.law import Law as Compiled
from mobee.robot.robot import Array, Robot


def squash(v: Array, maximum: Array | float, slope: Array | float) -> Array:
    """Eq. 5.8, every dimension by itself."""
    return maximum * v / (maximum / slope + np.abs(v))


def squash_norm(v: Array, maximum: float, slope: float) -> Array:
    """Eq. 5.8 of the norm, the direction kept."""
    return maximum * v / (maximum / slope + np.linalg.norm(v))


def limit_forces(robot: Robot, gains: Gains, q: Array) -> Array:
    """Eqs. 5.12-5.13."""
    width, maximum = gains.of_robot("limit_width", robot), gains.of_robot("max_limit", robot)
    zone = np.minimum(width, np.ptp(robot.limits, axis=1) / 4.0)
    below = np.maximum(robot.limits[:, 0] + zone - q, 0.0)
    above = np.maximum(q - robot.limits[:, 1] + zone, 0.0)
    return maximum / width * (below - above)


def clause_forces(robot: Robot, gains: Gains, q: Array) -> Array:
    """Eqs. 5.14-5.17, as the default law reads them."""
    rows = stack_clauses(robot.clauses, len(q))
    if not len(rows.b):
        return np.zeros(len(q))
    lack = 1.0 - (rows.a @ q + rows.b) / (rows.norms * gains.constraint_width)
    push = gains.max_constraint * np.maximum(np.minimum.reduceat(lack, rows.starts), 0.0)
    return push[rows.clause] @ rows.normals


def clause_forces_2014(robot: Robot, gains: Gains, q: Array) -> Array:
    """Eqs. 5.14-5.17, as the published law reads them."""
    rows = stack_clauses(robot.clauses, len(q))
    if not len(rows.b):
        return np.zeros(len(q))
    lack = 1.0 - (rows.a @ q + rows.b) / gains.constraint_width
    pushes = np.minimum.reduceat(lack, rows.starts) >= 0.0
    return gains.max_constraint * np.clip(np.where(pushes[rows.clause], lack, 0.0) @ rows.normals, -1.0, 1.0)


def collision_forces(robot: Robot, gains: Gains, torque: Array) -> Array:
    """Eq. 5.11."""
    force = gains.contact_gain * torque
    for part in robot.parts.values():
        f = force[part.slice]
        if gains.law == "published_2014":
            f = np.deg2rad(np.linalg.norm(f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force


def forces(robot: Robot, gains: Gains, q: Array, torque: Array) -> Forces:
    """All three."""
    clauses = clause_forces_2014 if gains.law == "published_2014" else clause_forces
    return Forces(limit_forces(robot, gains, q), clauses(robot, gains, q), collision_forces(robot, gains, torque))


class Law:
    """Eq. 5.7 with the limits of velocity and acceleration, and the position reference."""

    def __init__(self, robot: Robot, gains: Gains, speed_scale: float, q: Array) -> None:
        self.robot, self.gains = robot, gains
        self.speed = 0.999 * speed_scale * np.array([m.max_velocity for m in robot.motor_table])
        self.change = 0.999 * np.array([m.max_acceleration for m in robot.motor_table])
        self.velocity = self.acceleration = self.sent = np.zeros(len(q))
        self.reference = q

    def step(self, q: Array, dt: float, attractor: Array, force: Array) -> None:
        """One step; `force` the right-hand side."""
        own = {name: self.gains.of_robot(name, self.robot) for name in ("stiffness", "max_spring", "damping")}
        a = squash(attractor - q, own["max_spring"], own["stiffness"]) + force - own["damping"] * self.velocity
        wanted = self.gains.weight(self.robot.motors) * (self.velocity + a * dt)
        change = (np.clip(wanted, -self.speed, self.speed) - self.sent).clip(-self.change * dt, self.change * dt)
        velocity = self.sent + change
        self.acceleration = (velocity - self.velocity) / dt
        self.velocity = self.sent = velocity
        lead = self.reference - q
        blocked = (np.abs(lead) > 0.3 * self.speed) & (lead * velocity > 0)
        self.reference = np.clip(self.reference + np.where(blocked, 0.0, velocity * dt), *self.robot.limits.T)


def compiled_forces(robot: Robot, gains: Gains, q: Array, torque: Array | None = None) -> Forces:
    """The same of the compiled law."""
    return Forces(*Compiled(robot, gains).forces(q, np.zeros(len(q)) if torque is None else torque))
