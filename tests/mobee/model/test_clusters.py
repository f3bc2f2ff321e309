# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from mobee.model.core_tables import _rows, clusters
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import loaded, random_robot


def groups_of(robot: Robot, carried: int = 0) -> list[list[int]]:
    rows, _, _ = _rows(robot.shapes)
    extra = np.zeros(carried, dtype=rows.dtype)
    extra["bound"] = 0.1
    link = np.array([shape.link for shape in robot.shapes] + [0] * carried, dtype=np.intp)
    field = np.array([shape.role == "field" for shape in robot.shapes] + [False] * carried, dtype=np.bool_)
    return clusters(robot, np.concatenate([rows, extra]), link, field, len(rows))


@given(st.integers(0, 2**32), st.integers(0, 8), st.integers(0, 20), st.integers(0, 3))
def test_every_shape_is_in_one_group_of_its_role(seed: int, joints: int, shapes: int, carried: int) -> None:
    robot = random_robot(np.random.default_rng(seed), joints, shapes)
    groups = groups_of(robot, carried)
    assert sorted(index for group in groups for index in group) == list(range(shapes + carried))
    assert all(groups)
    assert groups[len(groups) - carried :] == [[shapes + k] for k in range(carried)]
    for group in groups[: len(groups) - carried]:
        assert len({robot.shapes[index].role for index in group}) == 1


def test_a_hand_is_one_group() -> None:
    """Far fewer groups than links, or they would save nothing."""
    robot = loaded("icub")
    links = len({(shape.link, shape.role) for shape in robot.shapes})
    assert len(groups_of(robot)) < links / 2


def test_groups_are_the_same_each_time() -> None:
    assert groups_of(loaded("icub")) == groups_of(loaded("icub"))
