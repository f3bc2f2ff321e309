from __future__ import annotations

import numpy as np
import pytest

from mobee.engine import engine_of
from mobee.engine.motion import bend_links, swung
from mobee.engine.pack import JOINTS, pack
from mobee.engine.track import _common, _widened
from mobee.kinematics import link_transforms
from mobee.robot.robot import Array, Robot
from tests.mobee.engine.random_scenes import Rng, posed, random_robot


def seen(robot: Robot, q: Array, shape: int, base: int) -> Array:
    """The centre of a shape (3,), in the frame of a link."""
    transforms = link_transforms(robot, q)
    link = transforms[robot.shapes[shape].link]
    return np.linalg.solve(transforms[base], link @ [*robot.shapes[shape].position, 1.0])[:3]


@pytest.mark.parametrize("seed", range(20))
def test_no_point_moves_farther_than_the_joints_between_allow(seed: int) -> None:
    rng: Rng = np.random.default_rng(seed)
    robot = random_robot(rng, 8, 12)
    engine_of(robot)
    packed = pack(robot)
    joints, links = int(packed.integers[JOINTS]), len(robot.links)
    further = _widened(packed, 0.02)[len(packed.floats) :]
    spans, levers, common = further[:joints], further[joints:], _common(packed).reshape(links, links)
    for step in (1e-3, 0.1, 3.0):
        q0 = posed(rng, robot)
        q1 = q0 + step * rng.normal(size=len(q0))
        matrix, offset = robot.coupling
        sums = np.empty(links), np.empty(links), np.empty(links)
        bend_links(packed.integers, matrix @ q1 + offset, matrix @ q0 + offset, spans, *sums)
        for place, shape in enumerate(packed.order):
            link = robot.shapes[shape].link
            for other in range(links):
                base = common[link, other]
                bound = swung(np.uint64(link), base, levers[place], *sums)
                way = seen(robot, q1, shape, int(base)) - seen(robot, q0, shape, int(base))
                assert np.linalg.norm(way) <= bound + 1e-9
                assert bound == pytest.approx(0.0, abs=1e-12) or int(base) != link


def test_the_last_common_link_carries_both_and_is_the_last_that_does(rng: Rng) -> None:
    robot = random_robot(rng, 10, 5)
    engine_of(robot)
    common = _common(pack(robot)).reshape(11, 11)
    carriers = [{0}]
    for joint in range(10):
        carriers.append({joint + 1, *carriers[robot.joints[joint].parent]})
    for one in range(11):
        for two in range(11):
            both = carriers[one] & carriers[two]
            assert int(common[one, two]) in both
            assert all(link in carriers[int(common[one, two])] for link in both)
