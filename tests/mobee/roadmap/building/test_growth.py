from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import KDTree

from mobee import MobeeError
from mobee.roadmap.building import search_schedule
from mobee.roadmap.building.chart import NEAREST
from mobee.roadmap.building.front import Front
from mobee.roadmap.building.growth import Growth
from tests.mobee.roadmap.toy import Level


def _grown(spacing: float = 0.06, seed: int = 0, **how: object) -> Growth:
    growth = Growth(Level(spacing), Front(**{"std": 0.02} | how), np.random.default_rng(seed))  # type: ignore[arg-type]
    while growth.step():
        assert growth.judge.problem.evaluations < 400_000, "it does not end"
    return growth


def _uncovered(growth: Growth) -> np.ndarray:
    """How far all that can be reached is from the nearest vertex, in spacings."""
    found: np.ndarray = KDTree(growth.chart.places).query(growth.judge.reachable())[0]  # type: ignore[attr-defined]
    return found


def test_it_covers_all_that_can_be_reached() -> None:
    growth = _grown()
    assert len(growth.chart) > 60
    assert (_uncovered(growth) <= 1.0).mean() > 0.98
    assert _uncovered(growth).max() < 1.5


def test_every_vertex_meets_the_terms_and_keeps_its_distance_to_all_others() -> None:
    growth = _grown(seed=1)
    seen = growth.judge.look(growth.result()[0])
    assert seen.good.all()
    assert np.allclose(seen.place, growth.chart.places)
    assert KDTree(growth.chart.places).query(growth.chart.places, 2)[0][:, 1].min() >= NEAREST


def test_the_same_seed_gives_the_same_map_and_another_seed_another() -> None:
    one, again, other = _grown(seed=3), _grown(seed=3), _grown(seed=4)
    assert np.array_equal(one.result()[0], again.result()[0])
    assert not np.array_equal(one.result()[0][:10], other.result()[0][:10])


@pytest.mark.parametrize("steps", [7, 60])
def test_a_growth_that_was_put_down_goes_on_to_the_same_map(steps: int) -> None:
    whole = _grown(seed=5)
    first = Growth(Level(0.06), Front(std=0.02), np.random.default_rng(5))
    for _ in range(steps):
        first.step()
    second = Growth(Level(0.06), Front(std=0.02), np.random.default_rng(99))
    second.restore({name: value.copy() for name, value in first.state().items()})
    second.rng.bit_generator.state = first.rng.bit_generator.state
    while second.step():
        pass
    assert np.array_equal(second.result()[0], whole.result()[0])
    assert np.array_equal(second.chart.edges, whole.chart.edges)


def test_without_the_test_of_the_frontier_it_ends_too_and_takes_longer() -> None:
    """Reading 9 of Algorithm 4 is ours: it saves searches that cannot find anything."""
    aimed, printed = _grown(0.08, predict=False), _grown(0.08, frontier=False)
    assert (_uncovered(printed) <= 1.0).mean() > 0.9
    per_vertex = [growth.judge.problem.evaluations / len(growth.chart) for growth in (aimed, printed)]
    assert per_vertex[1] > 1.3 * per_vertex[0]


def test_one_unlucky_search_ends_a_vertex_of_delta_1(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reading 8: so the map stops early where searches are short."""
    for name, value in (("LEAST", 1), ("FIRST_PATIENCE", 5)):
        monkeypatch.setattr(search_schedule, name, value)
    hurried = {"frontier": False, "patience": 1.0}
    hasty, patient = ([_grown(0.08, seed, delta=delta, **hurried).vertices for seed in range(3)] for delta in (1.0, 0.25))
    assert sum(hasty) < 0.6 * sum(patient)


def test_it_begins_at_the_heaviest_vertex_and_at_the_oldest_of_equal_ones() -> None:
    growth = Growth(Level(0.06), Front(searches=1), np.random.default_rng(0))
    q = np.array([[0.0, 1.0, -1.0], [0.4, 1.0, -1.4], [-0.3, 0.8, -0.5]])
    growth.begin_from(q, growth.judge.look(q).place * growth.judge.spacing)
    for weights, first in (([1.0, 1.0, 1.0], 0), ([0.5, 1.0, 1.0], 1), ([0.5, 0.5, 1.0], 2), ([0.5, 0.5, 0.5], 0)):
        growth.chart.weights[:] = weights
        growth.schedule.vertex[:] = search_schedule.IDLE
        growth.schedule.refill()
        assert growth.schedule.vertex[0] == first


def test_it_goes_on_from_given_vertices_and_keeps_them() -> None:
    whole = _grown(seed=6)
    kept = whole.result()[0][:20]
    growth = Growth(Level(0.06), Front(std=0.02), np.random.default_rng(1))
    growth.begin_from(kept, whole.chart.places[:20] * growth.judge.spacing)
    while growth.step():
        pass
    assert np.allclose(growth.result()[0][:20], kept)
    assert (_uncovered(growth) <= 1.0).mean() > 0.98


def test_nothing_to_be_found_is_said_and_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search_schedule, "FIRST_MOST", 5)
    judge = Level(0.05, low=(1.5, 1.5), high=(2.0, 2.0))
    growth = Growth(judge, Front(), np.random.default_rng(0))
    with pytest.raises(MobeeError, match=r"no pose was found .* misses level\. Loosen"):
        while growth.step():
            pass
