# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee import NES
from mobee.errors import InvalidValue
from mobee.roadmap.evolution.nes import METHODS
from mobee.roadmap.evolution.search import Restart, Search, Searches, _series, minimize

LIMITS = np.array([[-1.0, 2.0], [0.1, 0.3], [-5.0, -4.0]])
MIDDLE = LIMITS.mean(axis=1)


@pytest.mark.parametrize("method", METHODS)
@given(seed=st.integers(0, 10_000), std=st.floats(0.01, 100.0))
@settings(max_examples=15, deadline=None)
def test_no_sample_leaves_the_box(method: str, seed: int, std: float) -> None:
    search = Search(MIDDLE, std, LIMITS, Restart(patience=5), method=method, seed=seed)
    for _ in range(25):
        samples = search.ask()
        assert (samples >= LIMITS[:, 0]).all() and (samples <= LIMITS[:, 1]).all()
        search.tell(samples.sum(axis=1))


def test_an_optimum_on_the_border_is_found() -> None:
    found = minimize(lambda x: x @ [1.0, -1.0, 1.0], MIDDLE, 0.2, LIMITS, evaluations=2000)
    np.testing.assert_allclose(found.x, [-1.0, 0.3, -5.0], atol=1e-9)


def test_without_a_box_the_optimum_is_found_anywhere() -> None:
    found = minimize(lambda x: ((x - 1000.0) ** 2).sum(axis=1), np.zeros(3), 1.0, target=1e-8)
    np.testing.assert_allclose(found.x, 1000.0, atol=1e-4)
    assert found.starts == 1


def two_holes(x: np.ndarray) -> np.ndarray:
    """A wide hole that costs 1 at the start, and a narrow one that costs 0 far from it."""
    return np.minimum(1.0 + ((x - 0.2) ** 2).sum(axis=1), 20.0 * np.abs(x - 0.85).max(axis=1))


BOX = np.tile([0.0, 1.0], (2, 1))


def test_restarts_find_a_minimum_that_one_start_misses() -> None:
    stuck = minimize(two_holes, [0.2, 0.2], 0.05, BOX, target=0.1, evaluations=20_000)
    found = minimize(two_holes, [0.2, 0.2], 0.05, BOX, target=0.1, evaluations=20_000, restart=Restart())
    assert stuck.cost == pytest.approx(1.0) and stuck.starts == 1
    assert found.cost <= 0.1 and found.starts > 1


def test_starts_are_in_turn_the_first_and_random_ones() -> None:
    search = Search([0.2, 0.2], 1e-9, BOX, Restart(std=1.0))  # stuck at once, each time
    means = []
    for _ in range(4):
        samples = search.ask()
        means.append(samples.mean(axis=0))
        search.tell(np.zeros(len(samples)))
    np.testing.assert_allclose(means[0], 0.2, atol=1e-6)
    np.testing.assert_allclose(means[2], 0.2, atol=1e-6)
    assert np.abs(means[1] - 0.2).max() > 1e-3 and np.abs(means[3] - means[1]).max() > 1e-3


def test_a_cost_that_no_longer_falls_is_given_up() -> None:
    search = Search([0.5, 0.5], 0.1, BOX, Restart(std=0.0, patience=3))
    for _ in range(6):
        search.tell(np.ones(len(search.ask())))
    assert search.starts == 2


def hole_in_nothing(x: np.ndarray) -> np.ndarray:
    """A hole of radius 0.2 far from the start; everywhere else no sample is valid."""
    far = ((x - 0.8) ** 2).sum(axis=1)
    return np.where(far < 0.04, far, np.inf)


@pytest.mark.parametrize("seed", range(3))
def test_a_search_that_finds_no_valid_sample_begins_again(seed: int) -> None:
    found = minimize(hole_in_nothing, [0.2] * 3, 0.1, np.tile([0.0, 1.0], (3, 1)), 1e-4, 40_000, Restart(), seed=seed)
    assert found.cost <= 1e-4 and found.starts > 1


def test_the_first_valid_cost_is_a_gain() -> None:
    search = Search([0.5, 0.5], 0.1, BOX, Restart(std=0.0, patience=2))
    for cost in (np.inf, np.inf, np.inf, 1.0):
        search.tell(np.full(len(search.ask()), cost))
    assert search.starts == 1


@pytest.mark.parametrize("limits", [None, BOX])
def test_a_cost_that_computes_in_place_does_not_change_the_result(limits: np.ndarray | None) -> None:
    def distance(x: np.ndarray) -> np.ndarray:
        x -= 0.3
        return (x**2).sum(axis=1)

    np.testing.assert_allclose(minimize(distance, np.zeros(2), 0.5, limits, target=1e-8).x, 0.3, atol=1e-3)


def test_the_same_seed_gives_the_same_search() -> None:
    one, two, other = (minimize(two_holes, [0.5, 0.5], 0.2, BOX, evaluations=300, restart=Restart(), seed=seed) for seed in (4, 4, 5))
    np.testing.assert_array_equal(one.x, two.x)
    assert not np.array_equal(one.x, other.x)


def test_a_search_outside_the_box_is_led_back_by_the_penalty() -> None:
    """All samples are moved to the border and cost the same there, so only the distance to the box can lead the search."""
    search = Search([1.5, 1.5], 0.1, BOX, seed=1)
    before = search._nes.mean.copy()
    for _ in range(30):
        search.tell(np.zeros(len(search.ask())))
    assert np.abs(search._nes.mean - 0.5).max() < 0.6 < np.abs(before - 0.5).max()


def test_a_search_that_is_narrow_in_one_coordinate_only_continues() -> None:
    search = Search([0.5, 0.5], [1e-6, 0.1], BOX, Restart(std=1e-3))
    search.tell((search.ask() ** 2).sum(axis=1))
    assert search.starts == 1


def test_all_evaluations_are_used_if_they_are_whole_generations() -> None:
    assert minimize(lambda x: (x**2).sum(axis=1), np.ones(3), 1.0, evaluations=20, population=10).evaluations == 20


def test_never_more_evaluations_than_allowed() -> None:
    count = 0

    def counted(x: np.ndarray) -> np.ndarray:
        nonlocal count
        count += len(x)
        return (x**2).sum(axis=1)

    found = minimize(counted, np.ones(3), 1.0, evaluations=103)
    assert found.evaluations == count <= 103


def test_the_best_sample_is_kept() -> None:
    seen = []

    def noisy(x: np.ndarray) -> np.ndarray:
        costs = np.random.default_rng(len(seen)).uniform(size=len(x))
        seen.extend(zip(costs, x.tolist(), strict=True))
        return costs

    found = minimize(noisy, np.ones(2), 1.0, evaluations=500)
    cost, x = min(seen)
    assert found.cost == cost
    np.testing.assert_array_equal(found.x, x)


@pytest.mark.parametrize("limits", [[[0.0, 1.0]], [[0.0, 1.0], [1.0, 1.0]], [[0.0, 1.0], [0.0, np.inf]], [[0.0, 1.0], [0.0]]])
def test_a_box_that_does_not_fit_is_refused(limits: list[list[float]]) -> None:
    with pytest.raises(InvalidValue, match="limits"):
        Search([0.0, 0.0], 1.0, limits)


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"start": 0.0}, r"start has shape \(\)"),
        ({"std": [0.1, 0.1, 0.1]}, r"std has shape \(3,\); it must be one number, or \(2,\)"),
        ({"std": 0.0}, "std is 0.0"),
        ({"evaluations": 3}, "evaluations 3: must be at least 6"),
        ({"target": np.nan}, "target is nan"),
    ],
)
def test_arguments_that_do_not_fit_are_refused(wrong: dict[str, object], text: str) -> None:
    with pytest.raises(InvalidValue, match=text):
        minimize(two_holes, **({"start": [0.2, 0.2], "std": 0.1, "limits": BOX} | wrong))


def test_a_restart_needs_a_box() -> None:
    with pytest.raises(InvalidValue, match="limits"):
        Search([0.0], 1.0, restart=Restart())


def test_a_search_that_begins_again_forgets_the_previous_one() -> None:
    searches = Searches(1, 4, 8)
    which = np.array([0])
    rng = np.random.default_rng(0)
    searches.begin(0, np.zeros(4), 1.0)
    for _ in range(3):
        z = rng.standard_normal((1, 8, 4))
        searches.tell(which, z, (searches.ask(which, z) ** 2).sum(axis=2))
    searches.begin(0, np.full(4, 0.5), 0.1)
    z = rng.standard_normal((1, 8, 4))
    assert np.allclose(searches.ask(which, z), 0.5 + 0.1 * z)
    assert searches.age[0] == 0


def test_simultaneous_searches_equal_separate_ones() -> None:
    """Of other scale and age: some generations leave one of them out."""
    d, population, which = 3, 8, np.array([0, 2, 3])
    alone = {k: NES(np.full(d, k), 0.5 + k, population, seed=int(k)) for k in which}
    together = Searches(4, d, population)
    for k, one in alone.items():
        together.begin(k, one.mean, 0.5 + k)
    scales = {0: 1.0, 2: 30.0, 3: 0.01}
    for generation in range(30):
        some = which if generation % 3 else which[[0, 2]]
        samples = np.array([alone[k].ask() for k in some])
        z = np.array([alone[k]._z for k in some])
        np.testing.assert_allclose(together.ask(some, z), samples, rtol=1e-9, atol=1e-12)
        costs = np.array([((scales[k] * one * [1.0, 5.0, 25.0]) ** 2).sum(axis=1) for k, one in zip(some, samples, strict=True)])
        together.tell(some, z, costs)
        for k, values in zip(some, costs, strict=True):
            alone[k].tell(values)
    for k, one in alone.items():
        np.testing.assert_allclose(together.mean[k], one.mean, rtol=1e-8, atol=1e-12)
        np.testing.assert_allclose(together.sigma[k], one.sigma * (0.5 + k), rtol=1e-9)
        np.testing.assert_allclose(together.shape[k], one.shape, rtol=1e-8, atol=1e-9)
    assert together.age.tolist() == [30, 0, 20, 30]


def test_the_series_holds_for_small_and_large_matrices_at_once() -> None:
    from scipy.linalg import expm

    half = np.random.default_rng(3).normal(size=(2, 4, 4)) * np.array([0.001, 1.0])[:, None, None]
    a = half + half.transpose(0, 2, 1)
    np.testing.assert_allclose(a @ _series(a), expm(a) - np.eye(4), rtol=1e-9, atol=1e-12)
