# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee._core.engine import swung
from mobee.arrays import Array
from mobee.model.core_tables import robot_tables
from mobee.model.engine import robot_handle
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import Rng, posed, random_robot


def seen(robot: Robot, q: Array, shape: int, base: int) -> Array:
    """The centre of a shape (3,), in the frame of a link."""
    transforms = link_transforms(robot, q)
    link = transforms[robot.shapes[shape].link]
    return np.linalg.solve(transforms[base], link @ [*robot.shapes[shape].position, 1.0])[:3]


def common_link(robot: Robot, one: int, other: int) -> int:
    """The last link that carries both."""
    while one != other:
        one, other = (robot.joints[one - 1].parent, other) if one > other else (one, robot.joints[other - 1].parent)
    return one


@pytest.mark.parametrize("seed", range(20))
def test_no_point_moves_farther_than_the_joints_between_allow(seed: int) -> None:
    rng: Rng = np.random.default_rng(seed)
    robot = random_robot(rng, 8, 12)
    tables, links = robot_tables(robot), len(robot.links)
    for step in (1e-3, 0.1, 3.0):
        q0 = posed(rng, robot)
        q1 = q0 + step * rng.normal(size=len(q0))
        matrix, offset = robot.coupling
        bounds = swung(robot_handle(robot), matrix @ q0 + offset, matrix @ q1 + offset, len(robot.shapes))
        for place, shape in enumerate(tables.name):
            link = robot.shapes[shape].link
            for other in range(links):
                base, bound = common_link(robot, link, other), bounds[place, other]
                motion = seen(robot, q1, shape, base) - seen(robot, q0, shape, base)
                assert np.linalg.norm(motion) <= bound + 1e-9
                assert bound == pytest.approx(0.0, abs=1e-12) or base != link
