"""The force that drives fields out of each other (thesis eq. 5.11): f_coll = L(sum over contacts of J^T f)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mobee.control.gains import Gains
from mobee.control.squash import squash_norm
from mobee.robot.robot import Array, Robot

# "tree": a contact is felt down to the base, so that a hand on the table also stops the torso; "part": by the part's own motors.
Propagate = Literal["tree", "part"]


def collision_forces(robot: Robot, projection: Array, gains: Gains) -> Array:
    """Turn the sum of J^T d (n,) into a force in rad/s^2, its norm bounded part by part (eq. 5.8).

    The default law is linear in the penetration before it is bounded; the published one is quadratic,
    in degrees.
    """
    force = gains.contact_gain * projection
    if not force.any():
        return force
    for part in robot.parts.values():
        f = force[part.slice]
        if not f.any():
            continue
        if gains.law == "published_2014":
            f = np.deg2rad(np.sqrt(f @ f) * f)
        force[part.slice] = squash_norm(f, gains.max_contact, gains.contact_slope)
    return force
