# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from experiments.bench import scenes
from experiments.bench.scenes import MAKERS, MIXED, OBJECTS, PLAIN, Maker, boxes_world, upper_body, upper_body_poses
from mobee.model.engine import NO_HANDS
from mobee.model.fcl_engine import tested_pairs as pairs_of


def test_the_upper_body_has_the_size_that_is_documented() -> None:
    robot = upper_body()
    assert (len(robot.motors), len(robot.joints), len(robot.shapes)) == (41, 61, 129)
    assert Counter(shape.kind for shape in robot.shapes) == {"sphere": 58, "capsule": 56, "box": 15}
    assert (len(robot.field_pairs), len(robot.solid_pairs)) == (7451, 0)
    assert len(robot.untested) == 159


def test_pairs_of_base_and_boxes_are_not_tested_as_neither_moves() -> None:
    robot = upper_body()
    first, second, _ = pairs_of(robot, boxes_world(10).snapshot, NO_HANDS)
    base = [index for index, shape in enumerate(robot.shapes) if shape.link == 0]
    assert len(base) == 3
    assert not (np.isin(first, base) & (second >= len(robot.shapes))).any()
    assert len(first) == 7451 + 10 * (129 - 3)


def test_the_seed_decides_robot_world_and_poses() -> None:
    one, again, other = (scenes._random_robot.__wrapped__(MIXED, seed) for seed in (1, 1, 2))
    assert [shape.size for shape in one.shapes] == [shape.size for shape in again.shapes] != [shape.size for shape in other.shapes]
    few, many = (PLAIN.world(count).objects for count in (3, 9))
    assert list(many)[:3] == list(few)
    np.testing.assert_array_equal([few[name].position for name in few], [many[name].position for name in few])
    np.testing.assert_array_equal(MIXED.poses(5), MIXED.poses(9)[:5])


def test_links_that_are_mounted_on_each_other_are_not_tested() -> None:
    robot = MIXED.robot()
    tested = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in robot.field_pairs.tolist()}
    assert not tested & robot.untested.keys()
    assert all(frozenset((joint.parent, index + 1)) in robot.untested for index, joint in enumerate(robot.joints))


def test_poses_are_the_same_each_time_and_within_the_limits() -> None:
    low, high = upper_body().limits.T
    poses = upper_body_poses(50)
    assert ((low <= poses) & (poses <= high)).all()
    assert upper_body_poses(20) == pytest.approx(poses[:20])


@pytest.mark.parametrize("maker", MAKERS, ids=lambda maker: maker.name)
def test_kinds_come_in_equal_parts(maker: Maker) -> None:
    counted = Counter(shape.kind for shape in maker.robot().shapes)
    assert counted.keys() == set(maker.kinds) and len(set(counted.values())) == 1
    around = Counter(one.kind for one in maker.world(OBJECTS).objects.values())
    assert around.keys() == set(maker.around) and len(set(around.values())) == 1
