# SPDX-License-Identifier: Apache-2.0
"""The forces of the control law (thesis eqs. 5.7 to 5.17), each as a function beside its equation.

Every function takes the `State` of one tick and returns a force (n,), one number for each motor. The mass M of eq. 5.7 is 1, so a
force is an acceleration in rad/s^2. For a motor that slides, 1 rad stands for a length in m, its `unit` (`mobee.robot.motor_units`); for a
motor that turns, the unit is 1. `Gains` contains the parameters of the law, and its variant `Gains.law`: "default" or "published_2014".
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
    """The input of the control law in one tick (control period); arrays (n,) in the order of `robot.motors`.

    `q`: rad, measured. `velocity`: q', rad/s, the law's own state, not a difference of encoder values. `attractor`: q*, rad, the pose to
    which the spring pulls the motors. `contacts`: at q, as `Model.evaluate(q).contacts` returns them. `force`: f of eq. 5.9, the force on
    the motors that a client (the program that uses the controller) requests, rad/s^2; None: none. `pushes`: f_m of eq. 5.10, a dict from
    the name of a marker (a point on a link) to a force (3,), or force and moment (6,), root frame. `propagate`: "tree": a contact acts on
    all motors down to the base; "part": on the motors of the touching part only. `goal_velocity`: q*', rad/s, velocity of the attractor;
    None: it is at rest.
    """

    robot: Robot
    gains: Gains
    q: Array
    velocity: Array
    attractor: Array
    contacts: Sequence[Contact] = ()
    force: Array | None = None
    pushes: Mapping[str, Array] = field(default_factory=dict)
    propagate: Literal["tree", "part"] = "tree"
    goal_velocity: Array | None = None


def squash(v: Array, maximum: Array | float, slope: Array | float) -> Array:
    """Saturate v element by element (eq. 5.8): return L(v) = m v / (m / k + |v|).

    The absolute value stays below m = `maximum`; the slope at 0 is k = `slope`.
    """
    return maximum * v / (maximum / slope + np.abs(v))


def squash_norm(v: Array, maximum: float, slope: float) -> Array:
    """Saturate the norm of the vector v: return m v / (m / k + |v|) as in eq. 5.8, where |v| is the norm, so that v keeps its direction.

    The norm stays below m = `maximum`; the slope at 0 is k = `slope`.
    """
    return maximum * v / (maximum / slope + float(np.linalg.norm(v)))


def spring(s: State) -> Array:
    """Return the force of the spring, L(K (q* - q)), (n,) rad/s^2, as a term on the right-hand side of eq. 5.7.

    It pulls the motors to the attractor q* = `State.attractor`.
    """
    return squash(s.attractor - s.q, s.gains.of_robot("max_spring", s.robot), s.gains.of_robot("stiffness", s.robot))


def damping(s: State) -> Array:
    """Return the damping, -C q', (n,) rad/s^2, as a term on the right-hand side of eq. 5.7."""
    return -s.gains.of_robot("damping", s.robot) * s.velocity


def following(s: State, outside: Array) -> Array:
    """Return C q*', (n,) rad/s^2, which makes the damping relative to the velocity of the attractor; 0 if the attractor is at rest.

    The attractor is the pose to which the spring pulls the motors. `outside` (n,) rad/s^2: the sum of all forces except spring and damping.
    If this force on a motor opposes the velocity of its attractor, C q*' of this motor is reduced in proportion to the force, and is 0 for
    a force of YIELD (0.25 rad/s^2) or more.
    """
    if s.goal_velocity is None:
        return np.zeros(len(s.q))
    opposed = s.goal_velocity * outside < 0.0
    share = np.where(opposed, np.maximum(0.0, 1.0 - np.abs(outside) / (YIELD * motor_units(s.robot))), 1.0)
    found: Array = s.gains.of_robot("damping", s.robot) * s.goal_velocity * share
    return found


def config_force(s: State) -> Array:
    """Return f_config = L(f) (eq. 5.9), (n,) rad/s^2: the client's force f = `State.force`, saturated by `bounded_client`; 0 if None."""
    return bounded_client(s.robot, s.gains, s.force) if s.force is not None else np.zeros(len(s.q))


def work_force(s: State) -> Array:
    """Return f_work = L(sum over markers m of J(m)^T f_m) (eq. 5.10), (n,) rad/s^2.

    A marker is a point on a link. J(m) is its Jacobian, f_m its force (or force and moment) in `State.pushes`. L saturates
    the sum, see `bounded_client`. The element of a motor that slides is first multiplied by the square of its `motor_units`.
    """
    torque = np.zeros(len(s.q))
    for marker, push in s.pushes.items():
        torque += marker_jacobian(s.robot, s.q, marker)[: len(push)].T @ push
    return bounded_client(s.robot, s.gains, torque * motor_units(s.robot) ** 2)


def bounded_client(robot: Robot, gains: Gains, f: Array) -> Array:
    """Saturate the force f (n,) rad/s^2 of a client, the program that uses the controller: L of eqs. 5.9 and 5.10.

    With `gains.client_squash` "each", every motor is saturated separately (eq. 5.8 as printed). Otherwise the norm of the force on each
    part is saturated, so that the force on the part keeps its direction.
    """
    maximum, slope = gains.of_robot("max_client", robot), gains.of_robot("client_slope", robot)
    if gains.client_squash == "each":
        return squash(f, maximum, slope)
    bounded = np.zeros(len(f))
    for part in robot.parts.values():
        bounded[part.slice] = squash_together(f[part.slice], maximum[part.slice], slope[part.slice], motor_units(robot)[part.slice])
    return bounded


def squash_together(f: Array, maximum: Array, slope: Array, unit: Array) -> Array:
    """Saturate the norm of the force f (k,) on several motors, so that it keeps its direction.

    `maximum`, `slope` (k,): bound m and slope s at 0 of each motor, as in eq. 5.8. `unit` (k,): the motion of each motor that the control
    law treats as 1 rad (`mobee.robot.motor_units`). First m and f are divided by `unit`. Then the factor of a motor is m / (m / s + |f|),
    where |f| is the norm over all k motors. Every element of f is multiplied by the smallest of the k factors.
    """
    length = float(np.linalg.norm(f / unit))
    shares = maximum / unit / (maximum / unit / slope + length)
    return f * shares.min(initial=np.inf) if len(f) else f


def limit_force(s: State) -> Array:
    """Return f_lim (eqs. 5.12, 5.13), (n,) rad/s^2, which pushes the motors out of the zones at their limits.

    A zone is the range beside a limit. It has the width delta = `limit_width`; it is narrower for a motor with a narrow range, or if it
    would include the home position of a motor with `zone_ends_at_home` (`mobee.robot.motor_units.limit_zones`). The force is 0 between the
    two zones. In a zone it is a ramp that points inward, with slope f_max / delta (f_max = `max_limit`), and continues beyond the limit.
    The intervals of the cases in the thesis are misprinted; here the force is continuous and points inward.
    """
    width = s.gains.of_robot("limit_width", s.robot)
    (low, high), (below, above) = s.robot.limits.T, limit_zones(s.robot, width).T
    depth = np.maximum(low + below - s.q, 0.0) - np.maximum(s.q - high + above, 0.0)
    found: Array = s.gains.of_robot("max_limit", s.robot) / width * depth
    return found


def clause_force(s: State) -> Array:
    """Return f_cst (eqs. 5.14 to 5.17), (n,) rad/s^2, which keeps all clauses satisfied; `gains.law` chooses between its two variants.

    A clause is a condition on motor positions: a list of rows, inequalities a.q + b > 0, of which at least one must hold. It pushes while
    no row holds with a margin of `constraint_width`. The signs are those of the robot files; the thesis prints n.q < b (eq. 5.14).
    """
    return clauses_2014(s) if s.gains.law == "published_2014" else clauses_default(s)


def clauses_default(s: State) -> Array:
    """Return f_cst of the default law, (n,) rad/s^2: each clause pushes along the unit normals of all its rows (eqs. 5.15, 5.17).

    A clause is a condition on motor positions: a list of rows, inequalities a.q + b > 0, of which at least one must hold. It pushes while
    no row holds with a margin of `constraint_width`. The size of this push is `max_constraint` * (1 - d / `constraint_width`), or 0 if this
    is negative; d is the largest distance (a.q + b) / |a| of the rows. So the size is continuous: 0 where d is `constraint_width`, and
    `max_constraint` where d is 0.
    """
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        lengths = np.linalg.norm(clause.a * unit, axis=1)
        deficit = 1.0 - (clause.a @ s.q + clause.b) / (lengths * s.gains.constraint_width)  # 0 where the zone begins, 1 at the boundary
        size = s.gains.max_constraint * max(float(deficit.min()), 0.0)
        total += size * (clause.a * unit / lengths[:, None]).sum(axis=0)
    return total * unit


def clauses_2014(s: State) -> Array:
    """Return f_cst of the MoBeE program of 2014, (n,) rad/s^2: the force that keeps the clauses (conditions on motor positions) satisfied.

    A clause is a list of rows, inequalities a.q + b > 0, of which at least one must hold. The deficit of a row is 1 - (a.q + b) /
    `constraint_width`: 1 where a.q + b is 0, and 0 where it equals `constraint_width`. If no row of a clause has a negative deficit, each
    row pushes along its unit normal in proportion to its deficit. The sum is clipped to +-1 for each motor and multiplied by
    `max_constraint`.
    """
    unit, total = motor_units(s.robot), np.zeros(len(s.q))
    for clause in s.robot.clauses:
        deficit = 1.0 - (clause.a @ s.q + clause.b) / s.gains.constraint_width
        if deficit.min() >= 0.0:
            total += deficit @ (clause.a * unit / np.linalg.norm(clause.a * unit, axis=1)[:, None])
    return s.gains.max_constraint * np.clip(total, -1.0, 1.0) * unit


def contact_force(s: State) -> Array:
    """Return the collision force f_coll = L(sum over contact points g of J(g)^T f_g) (eq. 5.11), (n,) rad/s^2.

    f_g = +-depth * normal, in m: each contact of fields (volumes that cause repulsive forces) pushes the two volumes apart, in proportion
    to its depth. `projected` computes the sum, `bounded_contact` is L.
    """
    return bounded_contact(s.robot, s.gains, projected(s.robot, s.q, s.contacts, s.propagate))


def projected(robot: Robot, q: Array, contacts: Iterable[Contact], propagate: Literal["tree", "part"] = "tree") -> Array:
    """Return the sum of J(g)^T f_g in eq. 5.11, (n,) m^2/rad: two terms g for each contact of fields, one for each of its two links.

    f_g = depth * normal for the first link, and the opposite for the second. A field is a volume that causes a repulsive force; contacts
    between two solids are left out. `propagate`: "tree": a contact acts on all motors from its link down to the base; "part": only on the
    motors of the part that touches, as in MoBeE of 2014. If `robot.least_lever` is above 0, f_g is multiplied by `push_factor`, which
    strengthens contacts with a short lever (small J(g)).
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
    """Return the factor by which the push of a contact of fields is multiplied; 1 if `robot.least_lever` is 0.

    A field is a volume that causes a repulsive force, the push. If `robot.least_lever` is above 0, the factor is LEVER^2 / (|J|^2 +
    least_lever^2), with LEVER = 0.5 m, times the depth of the contact divided by the sum of the depths of all contacts of fields between
    the same two links. J (n,): the derivative of the depth with respect to each motor, in m/rad; for a slide, 1 rad stands for the length
    in `motor_units`. |J| is the lever of the contact. Without the factor, J^T pushes weakly if the lever is short. With it, the push is
    proportional to the smallest motion that ends the contact, J^T depth / |J|^2, if |J| is well above least_lever. The depths in the
    factor are weights, so that all contacts between two links together push about as strongly as a single one. `frames`: (L, 4, 4), as from
    `link_frames`. `contacts`: all contacts of the pose.
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
    """Saturate the norm of the contact force on each part (L of eq. 5.11, in the form of eq. 5.8); returns (n,) rad/s^2.

    `torque`: the sum in eq. 5.11, (n,) m^2/rad. The force before saturation is `torque` times `gains.contact_gain`. If `gains.law` is
    "published_2014", the force on each part is first multiplied by its own norm, as in the MoBeE program of 2014. That product is in
    deg/s^2; it is converted to rad/s^2 and then saturated.
    """
    unit = motor_units(robot)
    force = gains.contact_gain * torque * unit
    for part in robot.parts.values():
        f = force[part.slice]
        if gains.law == "published_2014":
            f = np.deg2rad(np.linalg.norm(f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force * unit


def joints_of_part(robot: Robot, link: int) -> list[int]:
    """Return the indices of the joints of the link's own part that lie between the link and the base, the nearest to the link first.

    The list ends before the first joint of another part.
    """
    part, chain = part_of(robot, link), []
    for j in joints_to(robot, link):
        if part_of(robot, j + 1) != part:
            break
        chain.append(j)
    return chain


def part_of(robot: Robot, link: int) -> str | None:
    """Return the name of the part that moves a link: the part of the motor that drives the link's joint.

    If no motor drives that joint, it is the part that moves the parent link. `link`: index. Returns None for the base, and for links that
    no motor moves.
    """
    matrix, _ = robot.coupling
    for j in joints_to(robot, link):
        driven = np.flatnonzero(matrix[j])
        if driven.size:
            return robot.motor_table[int(driven[0])].part
    return None
