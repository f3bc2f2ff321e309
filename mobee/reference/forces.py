"""The forces of eq. 5.7, each beside its equation, as functions of what the law sees in a tick.

The mass is 1, so a force is an acceleration: rad/s^2.  Of a motor that slides an angle of 1 rad counts as its `unit` in m
(`mobee.robot.motor_units`); where all motors turn, every unit is 1.  `Gains` say which law is meant and hold its numbers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.model.contact import Contact
from mobee.reference.contact_forces import projected
from mobee.reference.kinematics import marker_jacobian
from mobee.robot.motor_units import limit_zones, motor_units
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """What the law sees in a tick; arrays (n,) in the order of `robot.motors`.

    `force` is a client's force on the motors, `pushes` are its forces (3,), or forces and moments (6,), on markers.  `propagate`:
    how far down the body a contact is felt, see `projected`.
    """

    robot: Robot
    gains: Gains
    q: Array  # rad, as the encoders say
    velocity: Array  # rad/s, the law's own, never a difference of encoders
    attractor: Array  # q*, rad
    contacts: Sequence[Contact] = ()  # at q, as of `Model.evaluate(q).contacts`
    force: Array | None = None  # rad/s^2
    pushes: Mapping[str, Array] = field(default_factory=dict)
    propagate: Literal["tree", "part"] = "tree"


def squash(v: Array, maximum: Array | float, slope: Array | float) -> Array:
    """Eq. 5.8: L(v) = m v / (m / k + |v|), every dimension by itself: less than m, and of slope k at 0."""
    return maximum * v / (maximum / slope + np.abs(v))


def squash_norm(v: Array, maximum: float, slope: float) -> Array:
    """The same of the norm of v, which keeps its direction."""
    return maximum * v / (maximum / slope + float(np.linalg.norm(v)))


def spring(s: State) -> Array:
    """L(K (q* - q)) of eq. 5.7, on its right-hand side."""
    return squash(s.attractor - s.q, s.gains.of_robot("max_spring", s.robot), s.gains.of_robot("stiffness", s.robot))


def damping(s: State) -> Array:
    """-C q' of eq. 5.7."""
    return -s.gains.of_robot("damping", s.robot) * s.velocity


def config_force(s: State) -> Array:
    """Eq. 5.9: f_config = L(f), f of a client."""
    return bounded_client(s.robot, s.gains, s.force) if s.force is not None else np.zeros(len(s.q))


def work_force(s: State) -> Array:
    """Eq. 5.10: f_work = L(sum over markers of J^T f)."""
    torque = np.zeros(len(s.q))
    for marker, push in s.pushes.items():
        torque += marker_jacobian(s.robot, s.q, marker)[: len(push)].T @ push
    return bounded_client(s.robot, s.gains, torque * motor_units(s.robot) ** 2)


def bounded_client(robot: Robot, gains: Gains, f: Array) -> Array:
    """L(f) as a client's force is bounded: every motor by itself (eq. 5.8 as printed), or in each part keeping the direction."""
    maximum, slope = gains.of_robot("max_client", robot), gains.of_robot("client_slope", robot)
    if gains.client_squash == "each":
        return squash(f, maximum, slope)
    bounded = np.zeros(len(f))
    for part in robot.parts.values():
        bounded[part.slice] = squash_together(f[part.slice], maximum[part.slice], slope[part.slice], motor_units(robot)[part.slice])
    return bounded


def squash_together(f: Array, maximum: Array, slope: Array, unit: Array) -> Array:
    """L of the norm of some motors' force; where their bounds differ, the one that leaves least counts for all of them."""
    length = float(np.linalg.norm(f / unit))
    shares = maximum / unit / (maximum / unit / slope + length)
    return f * shares.min(initial=np.inf) if len(f) else f


def limit_force(s: State) -> Array:
    """Eqs. 5.12-5.13: zero inside [q_min + zone, q_max - zone], then a ramp of slope f_max / delta inward, at the limits and beyond.

    The thesis prints the ranges wrong; continuity and direction decide.  A zone is delta wide, less where a range is narrow or where it
    ends at home (`limit_zones`).
    """
    width = s.gains.of_robot("limit_width", s.robot)
    (low, high), (below, above) = s.robot.limits.T, limit_zones(s.robot, width).T
    depth = np.maximum(low + below - s.q, 0.0) - np.maximum(s.q - high + above, 0.0)
    found: Array = s.gains.of_robot("max_limit", s.robot) / width * depth
    return found


def clause_force(s: State) -> Array:
    """Eqs. 5.14-5.17: clauses, of which a robot wants all, push while none of their rows holds with margin.

    A row holds when a.q + b > 0: the robot files' convention, the thesis prints n.q < b.
    """
    return clauses_2014(s) if s.gains.law == "published_2014" else clauses_default(s)


def clauses_default(s: State) -> Array:
    """A clause pushes along the unit normals of all its rows; the row that lacks least sets the size, so that the force is continuous."""
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        lengths = np.linalg.norm(clause.a * unit, axis=1)
        lack = 1.0 - (clause.a @ s.q + clause.b) / (lengths * s.gains.constraint_width)  # 0 where the zone begins, 1 at the boundary
        size = s.gains.max_constraint * max(float(lack.min()), 0.0)
        total += size * (clause.a * unit / lengths[:, None]).sum(axis=0)
    return total * unit


def clauses_2014(s: State) -> Array:
    """The 2014 program: the zone is in units of a.q + b, each row pushes by what it lacks, the sum is clipped to +-1 a motor."""
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        lack = 1.0 - (clause.a @ s.q + clause.b) / s.gains.constraint_width
        if lack.min() >= 0.0:
            total += lack @ (clause.a * unit / np.linalg.norm(clause.a * unit, axis=1)[:, None])
    return s.gains.max_constraint * np.clip(total, -1.0, 1.0) * unit


def contact_force(s: State) -> Array:
    """Eq. 5.11: f_coll = L(sum over contacts of J^T f)."""
    return bounded_contact(s.robot, s.gains, projected(s.robot, s.q, s.contacts, s.propagate))


def bounded_contact(robot: Robot, gains: Gains, torque: Array) -> Array:
    """L of the contacts' sum (n,), by its norm over each part; in the 2014 program it is squared before that, in degrees."""
    unit = motor_units(robot)
    force = gains.contact_gain * torque * unit
    for part in robot.parts.values():
        f = force[part.slice]
        if gains.law == "published_2014":
            f = np.deg2rad(np.linalg.norm(f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force * unit
