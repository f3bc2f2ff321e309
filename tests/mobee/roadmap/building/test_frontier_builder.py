# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.spatial import KDTree

from mobee import MobeeError
from mobee.roadmap.building import search_scheduler
from mobee.roadmap.building.frontier import MIN_DISTANCE
from mobee.roadmap.building.frontier_builder import FrontierBuilder
from mobee.roadmap.building.search_scheduler import SearchSettings
from tests.mobee.roadmap.toy import Level


def _grown(spacing: float = 0.06, seed: int = 0, **how: Any) -> FrontierBuilder:
    builder = FrontierBuilder(Level(spacing), SearchSettings(**{"std": 0.02} | how), np.random.default_rng(seed))
    while builder.step():
        assert builder.evaluator.problem.evaluations < 400_000, "it does not end"
    return builder


def _uncovered(builder: FrontierBuilder) -> np.ndarray:
    """The largest distance of a reachable point from the nearest vertex, in spacings."""
    found: np.ndarray = KDTree(builder.frontier.points).query(builder.evaluator.reachable())[0]  # type: ignore[attr-defined]  # of Level
    return found


def test_it_covers_all_that_can_be_reached() -> None:
    builder = _grown()
    assert len(builder.frontier) > 60
    assert (_uncovered(builder) <= 1.0).mean() > 0.98
    assert _uncovered(builder).max() < 1.5


def test_every_vertex_meets_the_terms_and_keeps_its_distance_to_all_others() -> None:
    builder = _grown(seed=1)
    done = builder.evaluator.evaluate(builder.result()[0])
    assert done.valid.all()
    assert np.allclose(done.point, builder.frontier.points)
    assert KDTree(builder.frontier.points).query(builder.frontier.points, 2)[0][:, 1].min() >= MIN_DISTANCE


def test_the_same_seed_gives_the_same_map_and_another_seed_another() -> None:
    one, again, other = _grown(seed=3), _grown(seed=3), _grown(seed=4)
    assert np.array_equal(one.result()[0], again.result()[0])
    assert not np.array_equal(one.result()[0][:10], other.result()[0][:10])


@pytest.mark.parametrize("steps", [7, 60])
def test_an_interrupted_builder_resumes_to_the_same_roadmap(steps: int) -> None:
    whole = _grown(seed=5)
    first = FrontierBuilder(Level(0.06), SearchSettings(std=0.02), np.random.default_rng(5))
    for _ in range(steps):
        first.step()
    second = FrontierBuilder(Level(0.06), SearchSettings(std=0.02), np.random.default_rng(99))
    second.restore({name: value.copy() for name, value in first.state().items()})
    second.rng.bit_generator.state = first.rng.bit_generator.state
    while second.step():
        pass
    assert np.array_equal(second.result()[0], whole.result()[0])
    assert np.array_equal(second.frontier.edges, whole.frontier.edges)


def test_without_the_test_of_the_frontier_it_ends_too_and_takes_longer() -> None:
    """Reading 9 of Algorithm 4 is ours: it saves searches that cannot find anything."""
    aimed, printed = _grown(0.08, predict=False), _grown(0.08, frontier=False)
    assert (_uncovered(printed) <= 1.0).mean() > 0.9
    per_vertex = [builder.evaluator.problem.evaluations / len(builder.frontier) for builder in (aimed, printed)]
    assert per_vertex[1] > 1.3 * per_vertex[0]


def test_one_unlucky_search_ends_a_vertex_of_delta_1(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading 8: so the map stops early where searches are short."""
    for name, value in (("MIN_GENERATIONS", 1), ("FIRST_PATIENCE", 5)):
        monkeypatch.setattr(search_scheduler, name, value)
    hurried = {"frontier": False, "patience": 1.0}
    hasty, patient = ([_grown(0.08, seed, delta=delta, **hurried).vertices for seed in range(3)] for delta in (1.0, 0.25))
    assert sum(hasty) < 0.6 * sum(patient)


def test_it_begins_at_the_heaviest_vertex_and_at_the_oldest_of_equal_ones() -> None:
    builder = FrontierBuilder(Level(0.06), SearchSettings(searches=1), np.random.default_rng(0))
    q = np.array([[0.0, 1.0, -1.0], [0.4, 1.0, -1.4], [-0.3, 0.8, -0.5]])
    builder.begin_from(q, builder.evaluator.evaluate(q).point * builder.evaluator.spacing)
    for weights, first in (([1.0, 1.0, 1.0], 0), ([0.5, 1.0, 1.0], 1), ([0.5, 0.5, 1.0], 2), ([0.5, 0.5, 0.5], 0)):
        builder.frontier.weights[:] = weights
        builder.scheduler.vertex[:] = search_scheduler.IDLE
        builder.scheduler.refill()
        assert builder.scheduler.vertex[0] == first


def test_it_continues_from_given_vertices_and_keeps_them() -> None:
    whole = _grown(seed=6)
    kept = whole.result()[0][:20]
    builder = FrontierBuilder(Level(0.06), SearchSettings(std=0.02), np.random.default_rng(1))
    builder.begin_from(kept, whole.frontier.points[:20] * builder.evaluator.spacing)
    while builder.step():
        pass
    assert np.allclose(builder.result()[0][:20], kept)
    assert (_uncovered(builder) <= 1.0).mean() > 0.98


def test_a_task_out_of_reach_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search_scheduler, "MAX_FIRST_SEARCHES", 5)
    evaluator = Level(0.05, low=(1.5, 1.5), high=(2.0, 2.0))
    builder = FrontierBuilder(evaluator, SearchSettings(), np.random.default_rng(0))
    with pytest.raises(MobeeError, match=r"no pose was found .* misses level\. Loosen"):
        while builder.step():
            pass
