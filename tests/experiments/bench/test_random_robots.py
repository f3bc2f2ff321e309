from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from experiments.bench import random_robots
from experiments.bench.random_robots import CORNERS, HULLS, MAKERS, MIXED, OBJECTS, PLAIN, Maker
from mobee import Model


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_kinds_come_in_equal_parts(maker: Maker) -> None:
    counted = Counter(shape.kind for shape in random_robots.robot(maker).shapes)
    assert counted.keys() == set(maker.kinds) and len(set(counted.values())) == 1
    around = Counter(thing.kind for thing in random_robots.world(maker, OBJECTS).objects.values())
    assert around.keys() == set(maker.around) and len(set(around.values())) == 1


def test_hulls_have_as_many_corners_as_they_say() -> None:
    from scipy.spatial import ConvexHull

    for shape in random_robots.robot(HULLS).shapes:
        assert shape.vertices is not None
        assert len(ConvexHull(shape.vertices).vertices) == CORNERS


def test_the_seed_decides_robot_world_and_poses() -> None:
    one, again, other = (random_robots.robot.__wrapped__(MIXED, seed) for seed in (1, 1, 2))
    assert [shape.size for shape in one.shapes] == [shape.size for shape in again.shapes] != [shape.size for shape in other.shapes]
    few, many = (random_robots.world(PLAIN, count).objects for count in (3, 9))
    assert list(many)[:3] == list(few)
    np.testing.assert_array_equal([few[name].position for name in few], [many[name].position for name in few])
    np.testing.assert_array_equal(random_robots.poses(MIXED, 5), random_robots.poses(MIXED, 9)[:5])


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_poses_are_within_the_limits_and_touch_something_but_not_everything(maker: Maker) -> None:
    robot, q = random_robots.robot(maker), random_robots.poses(maker, 40)
    assert ((robot.limits[:, 0] <= q) & (q <= robot.limits[:, 1])).all()
    found = [len(Model(robot, random_robots.world(maker, count)).evaluate(q).table) / len(q) for count in (0, OBJECTS)]
    assert 0.5 < found[0] < 20.0 and 1.5 * found[0] < found[1] < 60.0


def test_links_that_are_mounted_on_each_other_are_not_tested() -> None:
    robot = random_robots.robot(MIXED)
    tested = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in robot.field_pairs.tolist()}
    assert not tested & robot.untested.keys()
    assert all(frozenset((joint.parent, index + 1)) in robot.untested for index, joint in enumerate(robot.joints))
