# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.model.core_tables import MANY_CORNERS, VOLUME, Carried, meets, robot_tables
from mobee.model.model import engine_of
from mobee.robot.robot import Robot
from tests.mobee.model.random_scenes import loaded, random_robot


def pairs_of(robot: Robot, carried: list[Carried]) -> set[frozenset[int]]:
    """The pairs that are tested, by index of the shape, then of the object that the robot carries."""
    tables = robot_tables(robot, carried)
    assert np.array_equal(tables.tested, tables.tested.T)
    return {frozenset((int(tables.name[a]), int(tables.name[b]))) for a, b in np.argwhere(tables.tested)}


@given(st.integers(0, 2**32), st.integers(0, 6), st.integers(0, 12), st.integers(0, 3))
def test_the_robots_pairs_are_tested_and_no_others(seed: int, joints: int, shapes: int, loads: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, shapes)
    row = np.array((0, np.zeros(3), np.eye(3), [0.1, 0.0, 0.0], 0.1), dtype=VOLUME)
    carried = [Carried(int(rng.integers(joints + 1)), row) for _ in range(loads)]
    expected = {frozenset((int(a), int(b))) for pairs in (robot.solid_pairs, robot.field_pairs) for a, b in pairs}
    links = [shape.link for shape in robot.shapes] + [one.link for one in carried]
    for load in range(shapes, shapes + loads):
        expected |= {frozenset((load, other)) for other in range(load) if meets(robot, links[load], links[other])}
    assert pairs_of(robot, carried) == expected


def test_a_carried_object_meets_neither_its_link_nor_links_untested_against_it() -> None:
    robot = loaded("icub")
    one, other = next(iter(robot.untested))
    assert not meets(robot, one, other)
    assert not meets(robot, 3, 3)
    free = next(frozenset((a, b)) for a in range(len(robot.links)) for b in range(a) if frozenset((a, b)) not in robot.untested)
    assert meets(robot, *free)


def test_counts_and_tables_fit_the_robot() -> None:
    robot = loaded("icub")
    tables = robot_tables(robot)
    counts, arrays = tables.for_core()
    assert (counts["motors"], counts["joints"], counts["shapes"]) == (len(robot.motors), len(robot.joints), len(robot.shapes))
    assert sorted(tables.name) == list(range(len(robot.shapes)))
    assert {int(i) for i in tables.name[~tables.meets_world]} == robot.base_shapes
    for row, index in zip(tables.volume, tables.name, strict=True):
        assert row["position"] == pytest.approx(robot.shapes[index].position)
    assert tables.cluster[0] == 0
    assert tables.cluster[-1] == len(robot.shapes)
    assert all(array.flags.c_contiguous for array in arrays.values())


def test_a_hull_of_many_corners_gets_its_edges_and_one_of_few_none(rng: np.random.Generator) -> None:
    robot = random_robot(rng, 1, 1)
    sides = rng.normal(size=(3 * MANY_CORNERS, 3))
    sides /= np.linalg.norm(sides, axis=1, keepdims=True)
    inside, corners = 0.5 * sides[:5], np.concatenate([0.5 * sides[:5], sides])
    shapes = tuple(
        replace(robot.shapes[0], kind="convex", size=(), vertices=vertices)
        for vertices in (sides[:4], corners, sides[:MANY_CORNERS], corners * [1.0, 1.0, 0.0])
    )
    tables = robot_tables(
        replace(robot, shapes=shapes, solid_pairs=np.empty((0, 2), dtype=np.intp), field_pairs=np.empty((0, 2), dtype=np.intp))
    )
    assert engine_of(robot) is not None
    for row, index in zip(tables.volume, tables.name, strict=True):
        first, count = int(row["half"][0]), int(row["half"][1])
        own, starts = tables.corner[first : first + count], tables.edge_start[first : first + count + 1]
        if index != 1:
            assert np.array_equal(own, shapes[index].vertices)
            assert starts[0] == starts[-1]
            continue
        assert {tuple(corner) for corner in own} == {tuple(corner) for corner in sides}
        assert not {tuple(corner) for corner in own} & {tuple(corner) for corner in inside}
        joined = [set(tables.edge[a:b].tolist()) for a, b in zip(starts, starts[1:], strict=False)]
        assert all(here in joined[there] for here, others in enumerate(joined) for there in others)
        assert sum(map(len, joined)) == 2 * (3 * count - 6)  # Euler's formula, all faces triangles


@pytest.mark.parametrize("parent", [-1, 2, 99])
def test_a_robot_whose_joints_stand_on_later_links_is_refused(parent: int, rng: np.random.Generator) -> None:
    robot = random_robot(rng, 3, 0)
    joints = (robot.joints[0], replace(robot.joints[1], parent=parent), robot.joints[2])
    with pytest.raises(InvalidValue, match="mounted on link"):
        robot_tables(replace(robot, joints=joints))


def test_a_robot_whose_shapes_stand_on_no_link_is_refused(rng: np.random.Generator) -> None:
    robot = random_robot(rng, 3, 2)
    with pytest.raises(InvalidValue, match="is on link 7"):
        robot_tables(replace(robot, shapes=(replace(robot.shapes[0], link=7), robot.shapes[1])))
