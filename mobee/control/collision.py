"""The force that drives fields out of each other (thesis eq. 5.11): f_coll = L(sum over contacts of J^T f)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from mobee.control.gains import Gains
from mobee.control.squash import squash_norm
from mobee.robot.robot import Array, Robot

if TYPE_CHECKING:
    from mobee.model import Pose

Propagate = Literal["tree", "part"]


def part_of_link(robot: Robot, link: int) -> str | None:
    """The part whose motors move the link with respect to its parent; None for the base."""
    matrix, _ = robot.coupling
    while link > 0:
        driven = np.flatnonzero(matrix[link - 1])
        if driven.size:
            return robot.motor_table[int(driven[0])].part
        link = robot.joints[link - 1].parent
    return None


def contact_projection(pose: Pose, propagate: Propagate) -> Array:
    """Every field contact's penetration vector [m] as configuration space sees it, sum of J^T d, shape (n,) in [m^2/rad].

    Both sides of a self contact get opposite vectors.  "tree": down to the base, so that a hand on the table also stops the
    torso; "part": the columns of the link's own part only, as in the original program.
    """
    robot = pose.robot
    total = np.zeros(len(robot.motor_table))
    for contact in pose.contacts:
        if contact.kind != "field":
            continue
        penetration = contact.depth * contact.normal
        for link, vector in ((contact.first_link, penetration), (contact.second_link, -penetration)):
            part = part_of_link(robot, link)
            if part is None:
                continue
            columns = robot.parts[part].slice if propagate == "part" else slice(None)
            total[columns] += (pose.point_jacobian(link, contact.point)[:3].T @ vector)[columns]
    return total


def collision_forces(robot: Robot, projection: Array, gains: Gains) -> Array:
    """Turn the sum of J^T d (n,) into a force in rad/s^2, its norm bounded part by part (eq. 5.8).

    The default law is linear in the penetration before it is bounded; the published one is quadratic,
    in degrees.
    """
    force = gains.contact_gain * projection
    for part in robot.parts.values():
        f = force[part.slice]
        if gains.law == "published_2014":
            f = np.deg2rad(np.sqrt(f @ f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force
