# SPDX-License-Identifier: Apache-2.0
"""The forces of the control law (thesis eqs. 5.7 to 5.17), each as a function beside its equation.

Every function takes the `State` of one tick and returns a force (n,), one number for each motor. The mass M of eq. 5.7 is 1, so a
force is an acceleration in rad/s^2. For a motor that slides, 1 rad stands for its `unit` in m (`mobee.robot.motor_units`); where all
motors turn, every unit is 1. `Gains` hold the numbers of the law and say which of its two variants is meant.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.control.gains import Gains
from mobee.model.contact import Contact
from mobee.reference.kinematics import joint_column, joints_to, link_frames, marker_jacobian
from mobee.robot.motor_units import limit_zones, motor_units
from mobee.robot.robot import LEVER, Robot

YIELD = 0.25  # rad/s^2: an opposing force of this size ends the motion with a moving attractor


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The input of the law in one tick; arrays (n,) in the order of `robot.motors`."""

    robot: Robot
    gains: Gains
    q: Array  # rad, measured
    velocity: Array  # q', rad/s: the law's own state, never a difference of encoder values
    attractor: Array  # q*, rad
    contacts: Sequence[Contact] = ()  # at q, as `Model.evaluate(q).contacts` gives them
    force: Array | None = None  # f of eq. 5.9, the client's force on the motors, rad/s^2
    pushes: Mapping[str, Array] = field(default_factory=dict)  # f_m of eq. 5.10 by marker: force (3,), or force and moment (6,)
    propagate: Literal["tree", "part"] = "tree"  # how far down the body a contact acts, see `projected`
    goal_velocity: Array | None = None  # q*', rad/s, of an attractor that moves


def squash(v: Array, maximum: Array | float, slope: Array | float) -> Array:
    """Saturate v element by element (eq. 5.8): L(v) = m v / (m / k + |v|), below m = `maximum` in size, of slope k = `slope` at 0."""
    return maximum * v / (maximum / slope + np.abs(v))


def squash_norm(v: Array, maximum: float, slope: float) -> Array:
    """Saturate the norm of v as eq. 5.8 does an element; the direction stays."""
    return maximum * v / (maximum / slope + float(np.linalg.norm(v)))


def spring(s: State) -> Array:
    """Return the pull of the attractor, L(K (q* - q)), on the right-hand side of eq. 5.7."""
    return squash(s.attractor - s.q, s.gains.of_robot("max_spring", s.robot), s.gains.of_robot("stiffness", s.robot))


def damping(s: State) -> Array:
    """Return the damping, -C q', on the right-hand side of eq. 5.7."""
    return -s.gains.of_robot("damping", s.robot) * s.velocity


def following(s: State, outside: Array) -> Array:
    """Return C q*', which makes the damping relative to the velocity of a moving attractor.

    `outside` (n,): the sum of all forces but spring and damping.  A motor yields to a force that
    opposes this velocity: it follows less, and not at all from YIELD on.
    """
    if s.goal_velocity is None:
        return np.zeros(len(s.q))
    opposed = s.goal_velocity * outside < 0.0
    share = np.where(opposed, np.maximum(0.0, 1.0 - np.abs(outside) / (YIELD * motor_units(s.robot))), 1.0)
    found: Array = s.gains.of_robot("damping", s.robot) * s.goal_velocity * share
    return found


def config_force(s: State) -> Array:
    """Return f_config = L(f) (eq. 5.9), where f is the client's force on the motors."""
    return bounded_client(s.robot, s.gains, s.force) if s.force is not None else np.zeros(len(s.q))


def work_force(s: State) -> Array:
    """Return f_work = L(sum over markers m of J(m)^T f_m) (eq. 5.10)."""
    torque = np.zeros(len(s.q))
    for marker, push in s.pushes.items():
        torque += marker_jacobian(s.robot, s.q, marker)[: len(push)].T @ push
    return bounded_client(s.robot, s.gains, torque * motor_units(s.robot) ** 2)


def bounded_client(robot: Robot, gains: Gains, f: Array) -> Array:
    """Saturate a client's force: every motor by itself (eq. 5.8 as printed), or the norm of each part, keeping its direction."""
    maximum, slope = gains.of_robot("max_client", robot), gains.of_robot("client_slope", robot)
    if gains.client_squash == "each":
        return squash(f, maximum, slope)
    bounded = np.zeros(len(f))
    for part in robot.parts.values():
        bounded[part.slice] = squash_together(f[part.slice], maximum[part.slice], slope[part.slice], motor_units(robot)[part.slice])
    return bounded


def squash_together(f: Array, maximum: Array, slope: Array, unit: Array) -> Array:
    """Saturate the norm of the force on several motors; where their bounds differ, the smallest factor counts for all of them."""
    length = float(np.linalg.norm(f / unit))
    shares = maximum / unit / (maximum / unit / slope + length)
    return f * shares.min(initial=np.inf) if len(f) else f


def limit_force(s: State) -> Array:
    """Return f_lim (eqs. 5.12, 5.13): zero inside [q_min + zone, q_max - zone], beyond it a ramp inward of slope f_max / delta.

    The ramp continues beyond the limit. The thesis misprints the ranges of the cases; here the force is continuous and points inward.
    A zone is delta = `limit_width` wide, and narrower where a range is narrow or where the zone ends at home (`limit_zones`).
    """
    width = s.gains.of_robot("limit_width", s.robot)
    (low, high), (below, above) = s.robot.limits.T, limit_zones(s.robot, width).T
    depth = np.maximum(low + below - s.q, 0.0) - np.maximum(s.q - high + above, 0.0)
    found: Array = s.gains.of_robot("max_limit", s.robot) / width * depth
    return found


def clause_force(s: State) -> Array:
    """Return f_cst (eqs. 5.14 to 5.17), which keeps all clauses satisfied; a clause acts while none of its rows holds with margin.

    A row holds when a.q + b > 0, the convention of the robot files; the thesis prints n.q < b (eq. 5.14).
    """
    return clauses_2014(s) if s.gains.law == "published_2014" else clauses_default(s)


def clauses_default(s: State) -> Array:
    """Return f_cst of the default law: each clause pushes along the unit normals of all its rows (eqs. 5.15, 5.17).

    The size of the push is computed from the row that is nearest to being satisfied, so that the force is continuous.
    """
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        lengths = np.linalg.norm(clause.a * unit, axis=1)
        deficit = 1.0 - (clause.a @ s.q + clause.b) / (lengths * s.gains.constraint_width)  # 0 where the zone begins, 1 at the boundary
        size = s.gains.max_constraint * max(float(deficit.min()), 0.0)
        total += size * (clause.a * unit / lengths[:, None]).sum(axis=0)
    return total * unit


def clauses_2014(s: State) -> Array:
    """Return f_cst of the 2014 program: the zone is in units of a.q + b, every row pushes by its own deficit, the sum is clipped to +-1."""
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        deficit = 1.0 - (clause.a @ s.q + clause.b) / s.gains.constraint_width
        if deficit.min() >= 0.0:
            total += deficit @ (clause.a * unit / np.linalg.norm(clause.a * unit, axis=1)[:, None])
    return s.gains.max_constraint * np.clip(total, -1.0, 1.0) * unit


def contact_force(s: State) -> Array:
    """Return the collision force f_coll = L(sum over contact points g of J(g)^T f_g) (eq. 5.11).

    f_g = +-depth * normal, in m: each contact of fields pushes the two volumes apart, in proportion to its depth.
    `projected` computes the sum, `bounded_contact` is L.
    """
    return bounded_contact(s.robot, s.gains, projected(s.robot, s.q, s.contacts, s.propagate))


def projected(robot: Robot, q: Array, contacts: Iterable[Contact], propagate: Literal["tree", "part"] = "tree") -> Array:
    """Return the sum in eq. 5.11: J(g)^T f_g over both sides g of every contact of fields, f_g = +-depth * normal; (n,) in m^2/rad.

    `propagate`: "tree": a contact acts on all motors down to the base; "part": on those of the part that touches, as in the original
    program. `Model` and python-fcl compute the depths, each by its own method. For a robot with a least lever f_g is multiplied by
    `push_factor`.
    """
    frames, per_joint, contacts = link_frames(robot, q), np.zeros(len(robot.joints)), list(contacts)
    for contact in contacts:
        if contact.kind == "field":
            force = contact.depth * contact.normal * push_factor(robot, frames, contact, contacts)
            for link, push in ((contact.first_link, force), (contact.second_link, -force)):
                for j in joints_to(robot, link) if propagate == "tree" else joints_of_part(robot, link):
                    per_joint[j] += joint_column(robot, frames, j, contact.point)[:3] @ push
    matrix, _ = robot.coupling
    per_motor: Array = per_joint @ matrix
    return per_motor


def push_factor(robot: Robot, frames: Array, contact: Contact, contacts: Sequence[Contact]) -> float:
    """Return 1; for a robot with a least lever, LEVER^2 / (|J|^2 + least_lever^2) times the contact's share in the depth between its links.

    J is the change of the depth when each motor moves by 1 rad (one that slides: by its `unit`). With this factor J^T pushes along the
    smallest motion that ends the contact, for any lever, and the contacts between two links push as one.
    """
    if robot.least_lever == 0.0:
        return 1.0
    links = {contact.first_link, contact.second_link}
    together = sum(one.depth for one in contacts if one.kind == "field" and {one.first_link, one.second_link} == links)
    change = np.zeros(len(robot.motors))
    for link, sign in ((contact.first_link, 1.0), (contact.second_link, -1.0)):
        for j in joints_to(robot, link):
            change += sign * robot.coupling[0][j] * (joint_column(robot, frames, j, contact.point)[:3] @ contact.normal)
    squares = float(np.sum((change * motor_units(robot)) ** 2))
    return contact.depth / together * LEVER**2 / (squares + robot.least_lever**2)


def bounded_contact(robot: Robot, gains: Gains, torque: Array) -> Array:
    """Saturate the sum of eq. 5.11, (n,), by its norm over each part (L of eq. 5.8); the 2014 program squares it first, in degrees."""
    unit = motor_units(robot)
    force = gains.contact_gain * torque * unit
    for part in robot.parts.values():
        f = force[part.slice]
        if gains.law == "published_2014":
            f = np.deg2rad(np.linalg.norm(f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force * unit


def joints_of_part(robot: Robot, link: int) -> list[int]:
    """Return the joints between a link and the first link of its part."""
    part, chain = part_of(robot, link), []
    for j in joints_to(robot, link):
        if part_of(robot, j + 1) != part:
            break
        chain.append(j)
    return chain


def part_of(robot: Robot, link: int) -> str | None:
    """Return the part of a link: that of the first motor that drives its joint, else the part of its parent link; None for the base."""
    matrix, _ = robot.coupling
    for j in joints_to(robot, link):
        driven = np.flatnonzero(matrix[j])
        if driven.size:
            return robot.motor_table[int(driven[0])].part
    return None
