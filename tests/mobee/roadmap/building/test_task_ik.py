# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

import mobee
from mobee import costs, tasks
from mobee.roadmap.building.task_ik import TaskIK, smoothed
from mobee.roadmap.ik.problem import Problem
from tests.mobee.planar import planar_arm

OFF = 0.01


@pytest.fixture(scope="module")
def row() -> tuple[Problem, TaskIK, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Places in a row, with postures that have nothing to do with each other."""
    problem = Problem(mobee.Model(planar_arm()), [costs.collision()], None, None)
    task = tasks.place("tip", "xy", [(0.2, 0.8), (-0.4, 0.4)])
    ik = TaskIK(problem, task, np.full(2, OFF))
    wanted = np.stack([np.full(40, 0.5), np.linspace(-0.3, 0.3, 40)], axis=1)
    starts = np.random.default_rng(0).uniform(-1.0, 1.0, (40, 3)) + [0.0, 1.2, 0.0]
    q, y, violations, _ = ik.solve(wanted, starts)
    assert (violations == 0.0).all()
    return problem, ik, wanted, q, y, np.stack([np.arange(39), np.arange(1, 40)], axis=1)


def steps(q: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    return np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]).max(axis=1)


def test_neighbours_come_nearer_and_stay_valid(row) -> None:
    problem, ik, wanted, q, y, pairs = row
    drawn, task = smoothed(ik, wanted, q, y, pairs, np.random.default_rng(0))
    assert np.median(steps(drawn, pairs)) < 0.5 * np.median(steps(q, pairs))
    assert problem.evaluate(drawn)[1].all()
    assert np.abs(task - wanted).max() <= OFF
    np.testing.assert_allclose(task, problem.model.evaluate(drawn).position("tip")[:, :2], atol=1e-12)


def test_similar_postures_are_kept(row) -> None:
    _, ik, wanted, q, y, pairs = row
    near = pairs[steps(q, pairs) < 0.2]
    drawn, task = smoothed(ik, wanted, q, y, near, np.random.default_rng(0))
    np.testing.assert_array_equal(drawn, q)
    np.testing.assert_array_equal(task, y)
    assert smoothed(ik, wanted[:0], q[:0], y[:0], pairs[:0], np.random.default_rng(0))[0].shape == (0, 3)
