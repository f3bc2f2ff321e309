from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from experiments.bench import workload
from mobee.model.fcl_engine import tested_pairs as rules
from mobee.model.snapshot import NO_HANDS


def test_it_has_the_size_that_it_says() -> None:
    robot = workload.robot()
    assert (len(robot.motors), len(robot.joints), len(robot.shapes)) == (41, 61, 129)
    assert Counter(shape.kind for shape in robot.shapes) == {"sphere": 58, "capsule": 56, "box": 15}
    assert (len(robot.field_pairs), len(robot.solid_pairs)) == (7451, 0)
    assert len(robot.untested) == 159


def test_as_solids_it_has_the_same_pairs() -> None:
    fields, solids = workload.robot("field"), workload.robot("solid")
    assert np.array_equal(solids.solid_pairs, fields.field_pairs)
    assert len(solids.field_pairs) == 0


def test_fewer_primitives_are_the_first_of_all() -> None:
    some = workload.robot(primitives=20)
    assert [shape.name for shape in some.shapes] == [f"s{index}" for index in range(20)]
    assert some.field_pairs.max() == 19


def test_each_world_is_the_beginning_of_the_next() -> None:
    few, many = workload.world(10), workload.world(100)
    assert (len(few.objects), len(many.objects)) == (10, 100)
    assert all(np.array_equal(few.objects[name].position, many.objects[name].position) for name in few.objects)


def test_base_and_boxes_are_not_tested_as_none_of_them_moves() -> None:
    robot = workload.robot()
    first, second, _ = rules(robot, workload.world(10).snapshot, NO_HANDS)
    base = [index for index, shape in enumerate(robot.shapes) if shape.link == 0]
    assert len(base) == 3
    assert not (np.isin(first, base) & (second >= len(robot.shapes))).any()
    assert len(first) == 7451 + 10 * (129 - 3)


def test_poses_are_the_same_each_time_and_within_the_limits() -> None:
    low, high = workload.robot().limits.T
    poses = workload.poses(50)
    assert ((low <= poses) & (poses <= high)).all()
    assert workload.poses(20) == pytest.approx(poses[:20])
