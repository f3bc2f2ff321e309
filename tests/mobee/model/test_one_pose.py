# SPDX-License-Identifier: Apache-2.0
"""One pose a call: its results are those of a batch, belong to the caller, and never change."""

from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee._core.engine import MANY
from mobee.errors import InvalidValue
from tests.mobee.model.random_scenes import loaded, posed, random_world


@pytest.fixture
def crowded(rng: np.random.Generator) -> mobee.Model:
    robot = loaded("icub")
    return mobee.Model(robot, random_world(rng, robot, 600, 0.5))


def test_a_pose_with_more_contacts_than_there_is_space_for_has_them_all(crowded: mobee.Model, rng: np.random.Generator) -> None:
    q = posed(rng, crowded.robot, 6)
    batch = crowded.evaluate(q).table
    assert np.bincount(batch.pose).max() > MANY
    for index, one in enumerate(q):
        table, rows = crowded.evaluate(one).table, batch.pose == index
        assert len(table) == rows.sum()
        assert np.array_equal(table.numbers[:, 1:], batch.numbers[rows, 1:])
        assert np.array_equal(table.reals, batch.reals[rows])


def test_results_stay_as_they_were(crowded: mobee.Model, rng: np.random.Generator) -> None:
    q = posed(rng, crowded.robot, 20)
    poses = [crowded.evaluate(one) for one in q]
    found = [(pose.table.numbers.copy(), pose.table.reals.copy(), pose.projection.copy()) for pose in poses]
    q[:] = 0.0
    again = [crowded.evaluate(pose.q) for pose in poses]
    for pose, same, (numbers, reals, projection) in zip(poses, again, found, strict=True):
        assert len(same.table) == len(numbers)
        assert np.array_equal(pose.table.numbers, numbers)
        assert np.array_equal(pose.table.reals, reals)
        assert np.array_equal(pose.projection, projection)
        assert not np.shares_memory(pose.projection, same.projection)
        assert not np.shares_memory(pose.table.reals, same.table.reals)


def test_the_angles_of_a_pose_are_a_copy_that_can_be_written_to(crowded: mobee.Model) -> None:
    given = crowded.robot.home.copy()
    pose = crowded.evaluate(given)
    given[0] = 1.0
    assert pose.q[0] == crowded.robot.home[0]
    pose.q[0] = 2.0
    assert pose.q[0] == 2.0


def test_a_table_cannot_be_given_other_columns(crowded: mobee.Model) -> None:
    table = crowded.evaluate(crowded.robot.home).table
    for name in ("shapes", "objects", "numbers", "reals", "depth"):
        with pytest.raises(AttributeError):
            setattr(table, name, ())


@pytest.mark.parametrize("value", [np.nan, -np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("motor", [0, -1])
def test_angles_that_are_not_finite_are_refused(value: float, motor: int) -> None:
    robot = loaded("katana")
    q = robot.home.copy()
    q[motor] = value
    with pytest.raises(InvalidValue, match=rf"{robot.motors[motor]!r} is -?(nan|inf)"):
        mobee.Model(robot).evaluate(q)


@pytest.mark.parametrize("value", [1e300, -1e300, 1e303, -1e308, 5e-324, -0.0])
def test_finite_angles_of_any_size_are_taken(value: float) -> None:
    robot = loaded("katana")
    q = np.full(len(robot.motors), value)
    pose = mobee.Model(robot).evaluate(q)
    assert pose.q.tobytes() == q.tobytes()
    assert np.isfinite(pose.transforms).all() or abs(value) > 1.0


def test_any_layout_of_one_pose_is_the_same_pose(crowded: mobee.Model, rng: np.random.Generator) -> None:
    q = posed(rng, crowded.robot, 1)[0]
    spread = np.zeros((len(q), 3))
    spread[:, 1] = q
    expected = crowded.evaluate(q)
    for given in (spread[:, 1], q[::-1].copy()[::-1], q.astype(">f8"), q.tolist(), tuple(q)):
        pose = crowded.evaluate(given)
        assert pose.q.tobytes() == q.tobytes()
        assert np.array_equal(pose.table.reals, expected.table.reals)
        assert np.array_equal(pose.projection, expected.projection)
