"""The projected contact forces of eq. 5.11, the sum of J^T f before saturation.

Each contact pushes the two things that overlap apart, as strongly as it is deep.  How deep, `Model` and python-fcl say, each by itself.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.model.contact import Contact
from mobee.reference.kinematics import joint_column, joints_to, link_frames
from mobee.robot.robot import Robot


def projected(robot: Robot, q: Array, contacts: Iterable[Contact], propagate: Literal["tree", "part"] = "tree") -> Array:
    """Sum of J(g)^T f_g over both sides g of every contact of fields, f_g = +-depth * normal; (n,) in m^2/rad.

    `propagate`: "tree", all motors down to the base feel a contact; "part", those of the part that touches, as in the original program.
    """
    frames, felt = link_frames(robot, q), np.zeros(len(robot.joints))
    for contact in contacts:
        if contact.kind == "field":
            force = contact.depth * contact.normal
            for link, push in ((contact.first_link, force), (contact.second_link, -force)):
                for j in joints_to(robot, link) if propagate == "tree" else joints_of_part(robot, link):
                    felt[j] += joint_column(robot, frames, j, contact.point)[:3] @ push
    matrix, _ = robot.coupling
    per_motor: Array = felt @ matrix
    return per_motor


def joints_of_part(robot: Robot, link: int) -> list[int]:
    """The joints between a link and where its part begins."""
    part, chain = part_of(robot, link), []
    for j in joints_to(robot, link):
        if part_of(robot, j + 1) != part:
            break
        chain.append(j)
    return chain


def part_of(robot: Robot, link: int) -> str | None:
    """The part that a link belongs to: of the first motor that drives its joint, else of the link that carries it; None of the base."""
    matrix, _ = robot.coupling
    for j in joints_to(robot, link):
        driven = np.flatnonzero(matrix[j])
        if driven.size:
            return robot.motor_table[int(driven[0])].part
    return None
