from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mobee.engine.layout import ROW
from mobee.engine.pack import F_REACH, F_ROW, I_START, I_WORLD, JOINTS, LINKS, MOTORS, SHAPES, Carried, meets, pack
from mobee.robot.robot import Robot
from tests.mobee.engine.random_scenes import loaded, random_robot


def pairs_of(robot: Robot, carried: list[Carried]) -> set[frozenset[int]]:
    """The pairs that the packed robot tests, by index of the shape, then of what it carries."""
    packed = pack(robot, carried)
    count, start = int(packed.integers[SHAPES]), int(packed.integers[F_REACH])
    reach = packed.floats[start : start + count * count].reshape(count, count)
    assert np.array_equal(reach, reach.T)
    return {frozenset((int(packed.order[a]), int(packed.order[b]))) for a, b in np.argwhere(reach > 0.0)}


@given(st.integers(0, 2**32), st.integers(0, 6), st.integers(0, 12), st.integers(0, 3))
def test_the_robots_pairs_are_tested_and_no_others(seed: int, joints: int, shapes: int, loads: int) -> None:
    rng = np.random.default_rng(seed)
    robot = random_robot(rng, joints, shapes)
    row = np.zeros(ROW)
    row[13], row[16], row[[4, 8, 12]] = 0.1, 0.1, 1.0
    carried = [Carried(int(rng.integers(joints + 1)), row) for _ in range(loads)]
    expected = {frozenset((int(a), int(b))) for pairs in (robot.solid_pairs, robot.field_pairs) for a, b in pairs}
    links = [shape.link for shape in robot.shapes] + [one.link for one in carried]
    for load in range(shapes, shapes + loads):
        expected |= {frozenset((load, other)) for other in range(load) if meets(robot, links[load], links[other])}
    assert pairs_of(robot, carried) == expected


def test_what_is_carried_meets_neither_its_own_link_nor_one_that_is_not_tested_against_it() -> None:
    robot = loaded("icub")
    one, other = next(iter(robot.untested))
    assert not meets(robot, one, other)
    assert not meets(robot, 3, 3)
    free = next(frozenset((a, b)) for a in range(len(robot.links)) for b in range(a) if frozenset((a, b)) not in robot.untested)
    assert meets(robot, *free)


def test_counts_and_tables_fit_the_robot() -> None:
    robot = loaded("icub")
    packed = pack(robot)
    counts = packed.integers[[MOTORS, JOINTS, LINKS, SHAPES]].tolist()
    assert counts == [len(robot.motors), len(robot.joints), len(robot.links), len(robot.shapes)]
    assert sorted(packed.order) == list(range(len(robot.shapes)))
    meets_world = packed.integers[int(packed.integers[I_WORLD]) :][: len(robot.shapes)].astype(bool)
    assert {int(i) for i in packed.order[~meets_world]} == robot.base_shapes
    first = int(packed.integers[F_ROW])
    for slot, index in enumerate(packed.order):
        assert packed.floats[first + slot * ROW + 1 : first + slot * ROW + 4] == pytest.approx(robot.shapes[index].position)
    assert packed.integers[int(packed.integers[I_START])] == 0


def test_all_tables_are_of_the_types_that_compiled_code_takes() -> None:
    packed = pack(random_robot(np.random.default_rng(0), joints=0, shapes=0))
    assert (packed.integers.dtype, packed.floats.dtype, packed.vertices.dtype) == (np.uint64, np.float64, np.float64)
    assert all(array.flags.c_contiguous for array in (packed.integers, packed.floats, packed.vertices))
