from __future__ import annotations

import numpy as np
import pytest

import mobee
from experiments.trm import coverage as module
from experiments.trm.coverage import coverage, reachable, valid
from mobee import costs, tasks
from mobee.roadmap.building.flood import Patience, flooded
from mobee.roadmap.ik.problem import Problem
from tests.mobee.planar import planar_arm

SPACING = np.array([0.15, 0.15])
TASK = tasks.place("tip", "xy", [(0.0, 1.0), (-0.6, 0.6)])
TERMS = [costs.collision()]


@pytest.fixture(scope="module")
def arm() -> mobee.Model:
    return mobee.Model(planar_arm())


@pytest.fixture(autouse=True)
def brief(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "GENEROUS", Patience(tries=4))
    monkeypatch.setattr(module, "BLIND", 50)
    monkeypatch.setattr(module, "STARTS", 4)


@pytest.fixture(scope="module")
def whole(arm: mobee.Model) -> tuple[np.ndarray, np.ndarray]:
    return flooded(Problem(arm, TERMS, None, None), TASK, SPACING, np.random.default_rng(0))


def test_a_whole_map_covers_all(arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    points = reachable(arm, TERMS, TASK, SPACING)
    np.testing.assert_array_equal(points, reachable(arm, TERMS, TASK, SPACING))
    found = coverage(points, whole[1], SPACING)
    assert found.share > 0.99 and found.largest_hole < 1.2
    assert np.linalg.norm(found.reachable, axis=1).max() <= 0.9 + 1e-9
    assert len(points) > 3 * len(whole[1]) and len(found.far) == len(points) + len(whole[1])


def test_a_hole_is_seen(arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    y = whole[1]
    left = y[np.linalg.norm(y - [0.5, 0.0], axis=1) > 0.32]
    found = coverage(reachable(arm, TERMS, TASK, SPACING), left, SPACING)
    assert found.share < 0.99
    assert found.largest_hole == pytest.approx(np.linalg.norm((left - [0.5, 0.0]) / SPACING, axis=1).min(), abs=0.5)


def test_what_is_wrong_with_a_pose_is_seen(arm: mobee.Model, whole: tuple[np.ndarray, np.ndarray]) -> None:
    q, y = whole[0][:6].copy(), whole[1][:6].copy()
    assert valid(arm, TERMS, TASK, q, y).all()
    q[1, 0] += 1e-6  # not where y says
    q[2] = [0.0, 3.0, 3.0]  # folded into itself
    y[2] = TASK.of(arm.evaluate(q[2:3]))[0]
    q[3, 2] = 3.5  # beyond its limit
    y[3] = TASK.of(arm.evaluate(q[3:4]))[0]
    assert valid(arm, TERMS, TASK, q, y).tolist() == [True, False, False, False, True, True]
    assert not valid(arm, TERMS, TASK, q[4:5] + [0.0, 0.0, 1e-12], y[4:5], motors=["m0", "m1"]).any()
