# SPDX-License-Identifier: Apache-2.0
"""The levers of contacts, and the factors on repulsive forces that are computed from the levers.

The lever of a contact is the change of its depth if the motors move by 1 rad.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.model.kinematics import point_jacobian
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import LEVER, Robot


def lever(robot: Robot, transforms: Array, links: tuple[int, int], point: Array, normal: Array) -> float:
    """Return the lever of a contact of two links [m/rad]: the norm of the derivatives of its depth with respect to the motor positions.

    A joint that moves both links does not count. For a motor that slides, a certain length replaces 1 rad, see
    `mobee.robot.motor_units.motor_units`. `transforms`: (L, 4, 4) of all links. `links`: indices; below 0: a free object (an object of
    the world that is on no link). `point` (3,) m and `normal` (3,) of the contact: root frame, in this pose.
    """
    change = np.zeros(len(robot.motors))
    for link, sign in zip(links, (1.0, -1.0), strict=True):
        if link > 0:
            change += sign * (normal @ point_jacobian(robot, transforms, link, point)[:3])
    return float(np.linalg.norm(change * motor_units(robot)))


def push_factors(robot: Robot, transforms: Array, links: Ints, depths: Array, points: Array, normals: Array) -> Array:
    """Return the factors (c,) that multiply the repulsive pushes, depth * normal, of c contacts of fields.

    Fields are volumes that cause repulsive forces. The factors are 1 if `robot.least_lever` is 0. Otherwise a factor is LEVER^2 / (lever^2
    + least_lever^2) * depth / total, with LEVER = 0.5 m; the total is the sum of the depths of all contacts between the same two links.
    This is our extension of thesis eq. 5.11 (docs/law.md). `transforms`: (L, 4, 4) of all links. `links` (c, 2): indices; all free objects
    (-1, objects of the world that are on no link) count as one link. `depths` (c,) m, `points` (c, 3) m, `normals` (c, 3): of the contacts,
    root frame.
    """
    factors = np.ones(len(depths))
    if robot.least_lever <= 0.0:
        return factors
    pairs = [tuple(sorted(pair)) for pair in links.tolist()]
    for k, (pair, point, normal) in enumerate(zip(links.tolist(), points, normals, strict=True)):
        together = sum(depth for depth, other in zip(depths.tolist(), pairs, strict=True) if other == pairs[k])
        squares = lever(robot, transforms, (pair[0], pair[1]), point, normal) ** 2 + robot.least_lever**2
        factors[k] = depths[k] / together * LEVER**2 / squares
    return factors
