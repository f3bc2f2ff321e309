# SPDX-License-Identifier: Apache-2.0
"""The levers of contacts, and how the pushes of contacts depend on them where a robot has a least lever."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.model.kinematics import joint_axes
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import LEVER, Robot


def lever(robot: Robot, transforms: Array, links: tuple[int, int], point: Array, normal: Array) -> float:
    """Return the lever of a contact of two links [m]: the norm of the changes of its depth when each motor moves by 1 rad of the law.

    Only the joints count that move one of the links. `transforms` (L, 4, 4); `point` (3,) m and `normal` (3,): root frame, now. A link
    below 0 is a free object.
    """
    first, second = (_above(robot, link) for link in links)
    joints = np.array(sorted(first ^ second), dtype=np.intp)
    axes, points = (one[joints] for one in joint_axes(robot, transforms))
    slides = np.array([robot.joints[joint].kind == "prismatic" for joint in joints], dtype=bool)
    moved = np.where(slides[:, None], axes, np.cross(axes, point - points)) @ normal
    sign = np.array([1.0 if joint in first else -1.0 for joint in joints])
    return float(np.linalg.norm((sign * moved) @ (robot.coupling[0][joints] * motor_units(robot))))


def push_factors(robot: Robot, transforms: Array, links: Ints, depths: Array, points: Array, normals: Array) -> Array:
    """Return the factors (c,) of the pushes of contacts of fields, depth * normal: all 1 unless the robot has a least lever.

    Then the factor is LEVER^2 / (lever^2 + least_lever^2), times the share of the contact in the depth of all contacts of its two links.
    `links` (c, 2), `depths` (c,) m, `points` (c, 3) m, `normals` (c, 3); all free objects count as one link.
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


def _above(robot: Robot, link: int) -> set[int]:
    """Return the joints between a link and the base."""
    joints = set()
    while link > 0:
        joints.add(link - 1)
        link = robot.joints[link - 1].parent
    return joints
