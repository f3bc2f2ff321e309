# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import cma
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue, UnknownName
from mobee.roadmap.evolution.nes import METHODS, NES, default_population, path_rates, published_utilities
from mobee.roadmap.evolution.search import Search

D = 4
seeds = st.integers(0, 10_000)


def rugged(x: np.ndarray) -> np.ndarray:
    """No optimum at a special place, no symmetry."""
    return np.abs(x - np.arange(x.shape[1])) @ np.arange(1.0, x.shape[1] + 1.0) + np.sin(3.0 * x[:, 0])


def generations(es: NES, cost, count: int = 30) -> np.ndarray:
    asked = []
    for _ in range(count):
        asked.append(es.ask())
        es.tell(cost(asked[-1]))
    return np.array(asked)


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_a_growing_function_of_the_cost_changes_nothing(method: str, seed: int) -> None:
    plain = generations(NES(np.zeros(D), 1.0, method=method, seed=seed), rugged)
    grown = generations(NES(np.zeros(D), 1.0, method=method, seed=seed), lambda x: np.arctan(0.1 * rugged(x)) - 7.0)
    np.testing.assert_array_equal(plain, grown)


@pytest.mark.parametrize("method", METHODS)
@given(seed=seeds, far=st.floats(-50.0, 50.0), times=st.floats(0.1, 10.0))
@settings(max_examples=10, deadline=None)
def test_a_shift_and_another_unit_of_the_coordinates_change_nothing(method: str, seed: int, far: float, times: float) -> None:
    shift = far * np.ones(D)
    plain = generations(NES(np.zeros(D), 1.0, method=method, seed=seed), rugged, 15)
    moved = generations(NES(shift, times, method=method, seed=seed), lambda x: rugged((x - shift) / times), 15)
    np.testing.assert_allclose((moved - shift) / times, plain, atol=1e-6)


@pytest.mark.parametrize("method", ["full", "xnes"])
@given(seed=seeds)
@settings(max_examples=10, deadline=None)
def test_a_rotation_changes_nothing(method: str, seed: int) -> None:
    rotation = np.linalg.qr(np.random.default_rng(seed).standard_normal((D, D)))[0]
    plain = generations(NES(np.ones(D), 1.0, method=method, seed=seed), rugged, 15)
    turned = NES(rotation @ np.ones(D), 1.0, method=method, seed=seed)
    turned.shape = rotation
    np.testing.assert_allclose(generations(turned, lambda x: rugged(x @ rotation), 15) @ rotation, plain, atol=1e-6)


@pytest.mark.parametrize(("method", "most"), [("full", 100), ("separable", 100), ("xnes", 400), ("snes", 150)])
def test_every_method_finds_the_optimum_of_a_sphere(method: str, most: int) -> None:
    best = np.array([0.3, -2.0, 1.0])
    es = NES(np.zeros(3), 0.5, method=method, seed=1)
    generations(es, lambda x: ((x - best) ** 2).sum(axis=1), most)
    np.testing.assert_allclose(es.mean, best, atol=1e-4)


def test_the_full_form_finds_the_optimum_of_a_rotated_valley() -> None:
    rotation = np.linalg.qr(np.random.default_rng(0).standard_normal((5, 5)))[0]
    scales = 10.0 ** (6.0 * np.arange(5) / 4.0)
    es = NES(np.ones(5), 0.5, seed=2)
    generations(es, lambda x: ((x @ rotation) ** 2) @ scales, 300)
    assert ((es.mean @ rotation) ** 2) @ scales < 1e-8


def test_the_shape_stays_positive_definite_under_absurd_ranks() -> None:
    rng = np.random.default_rng(3)
    es = NES(np.zeros(6), 1.0, seed=3)
    generations(es, lambda x: rng.uniform(size=len(x)), 300)
    assert np.linalg.eigvalsh(es.shape @ es.shape.T).min() > 0.0


def test_the_exponential_is_that_of_the_whole_matrix() -> None:
    from scipy.linalg import expm

    from mobee.roadmap.evolution.nes import turned

    rng = np.random.default_rng(0)
    z, weights, shape = rng.standard_normal((7, 4)), rng.uniform(-0.2, 0.5, 7), rng.standard_normal((4, 4))
    exponent = 0.5 * ((z.T * weights) @ z - 0.3 * np.eye(4))
    np.testing.assert_allclose(turned(shape, z, weights, 0.3), shape @ expm(exponent), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(turned(np.ones(4), z, weights, 0.3), np.exp(np.diag(exponent)), rtol=1e-12)


def test_a_generation_of_the_published_full_form_is_one_exponential() -> None:
    """Glasmachers et al. 2010: the shape with its size becomes exp(rate / 2 sum_i u_i z_i z_i^T)."""
    from scipy.linalg import expm

    es = NES(np.zeros(D), 1.0, population=9, method="xnes", seed=4)
    z = es.ask()
    es.tell(np.arange(9.0))
    rate = 0.6 * (3.0 + np.log(D)) / (D * np.sqrt(D))
    np.testing.assert_allclose(es.sigma * es.shape, expm(0.5 * rate * (z.T * published_utilities(9)) @ z), rtol=1e-12, atol=1e-12)


def test_the_step_size_grows_at_most_by_e_in_a_generation() -> None:
    es = NES(np.zeros(D), 1.0, seed=4)
    es.path = np.full(D, 10.0)
    es.ask()
    es.tell(np.arange(float(es.population)))
    assert es.sigma == pytest.approx(np.e)


def test_a_long_series_ends() -> None:
    from scipy.linalg import expm

    from mobee.roadmap.evolution.nes import turned

    z = np.array([[4.0, 0.0], [0.0, 2.0]])
    np.testing.assert_allclose(turned(np.eye(2), z, np.ones(2), 1.0), expm(np.diag([7.5, 1.5])), rtol=1e-10)


@given(d=st.integers(1, 100), population=st.integers(4, 60), separable=st.booleans())
@settings(max_examples=50, deadline=None)
def test_the_rates_leave_something_of_the_shape(d: int, population: int, separable: bool) -> None:
    rates = path_rates(d, population, separable)
    assert rates.weights[rates.weights > 0].sum() == pytest.approx(1.0)
    assert (np.diff(rates.weights) <= 0).all()
    assert rates.rank_one > 0 and rates.rank_all > 0 and rates.rank_one + rates.rank_all <= 1.0
    assert 0 < rates.path < 1
    negative = -rates.weights[rates.weights < 0].sum()
    assert rates.rank_all * negative * d <= 1.0 - rates.rank_one - rates.rank_all + 1e-12  # CMA's bound


@pytest.mark.parametrize(("d", "population"), [(2, 6), (10, 10), (40, 15), (10, 40), (3, 100)])
def test_the_rates_of_the_shape_are_those_of_pycma(d: int, population: int) -> None:
    rates, theirs = path_rates(d, population), cma.CMAEvolutionStrategy(np.zeros(d), 1.0, {"popsize": population, "verbose": -9})
    mine = [rates.effective, rates.rank_one, rates.rank_all, rates.length]
    np.testing.assert_allclose(mine, [theirs.sp.weights.mueff, theirs.sp.c1, theirs.sp.cmu, theirs.const.chiN], rtol=1e-12)
    np.testing.assert_allclose(rates.weights, np.array(theirs.sp.weights), atol=1e-12)


@pytest.mark.parametrize(
    ("d", "population", "path", "damping"), [(10, 10, 0.2844285879, 1.2844285879), (3, 100, 0.8284079507, 4.9241566753)]
)
def test_path_and_damping_are_those_of_the_tutorial(d: int, population: int, path: float, damping: float) -> None:
    """By hand from the formulas of Hansen 2016 (arXiv:1604.00772); effective numbers of samples: 3.1672992814 and 26.9666550647."""
    rates = path_rates(d, population)
    assert (rates.path, rates.damping) == pytest.approx((path, damping), rel=1e-9)


def test_a_diagonal_shape_learns_faster_by_the_ratio_of_the_parameters() -> None:
    full, diagonal = path_rates(10, 10), path_rates(10, 10, separable=True)
    assert diagonal.rank_one / full.rank_one == pytest.approx(4.0)
    assert diagonal.rank_all / full.rank_all == pytest.approx(4.0)


def test_published_utilities_by_hand() -> None:
    raw = np.array([np.log(3.0), np.log(3.0) - np.log(2.0), 0.0, 0.0])
    np.testing.assert_allclose(published_utilities(4), raw / raw.sum() - 0.25)


def test_default_population() -> None:
    assert [default_population(d) for d in (1, 10, 20, 41)] == [4, 10, 12, 15]


def test_std_is_that_of_the_samples() -> None:
    es = NES(np.zeros(3), [0.1, 1.0, 10.0], population=4000, seed=0)
    np.testing.assert_allclose(es.ask().std(axis=0), es.std, rtol=0.05)


def test_an_infinite_cost_is_the_worst() -> None:
    es = NES(np.zeros(2), 1.0, seed=0)
    generations(es, lambda x: np.where(x[:, 0] < 0.0, np.inf, (x**2).sum(axis=1)), 60)
    np.testing.assert_allclose(es.mean, 0.0, atol=1e-2)


@pytest.mark.parametrize(
    "make",
    [
        lambda: NES([], 1.0),
        lambda: NES([np.nan], 1.0),
        lambda: NES([0.0, 0.0], [1.0, 1.0, 1.0]),
        lambda: NES([0.0], 0.0),
        lambda: NES([0.0, 0.0], [1.0, 0.0]),
        lambda: NES(0.0, 1.0),
        lambda: NES(["a"], 1.0),
        lambda: NES([0.0], "a"),
        lambda: NES([0.0], 1.0, population=3),
        lambda: NES([0.0], 1.0, population=8.5),
        lambda: NES([0.0], 1.0).tell([1.0] * 4),
    ],
)
def test_invalid_arguments_are_refused(make) -> None:
    with pytest.raises(InvalidValue):
        make()


def test_an_unknown_method_is_refused_with_the_nearest() -> None:
    with pytest.raises(UnknownName, match="snes"):
        NES([0.0], 1.0, method="sness")


@pytest.mark.parametrize(
    ("costs", "text"),
    [([1.0], r"\(1,\); they must be \(4,\)"), ([1.0, 2.0, np.nan, 3.0], "1 of 4 costs are NaN"), (1.0, r"\(\)"), ([1j] * 4, "complex")],
)
@pytest.mark.parametrize("make", [NES, Search])
def test_costs_that_do_not_fit_are_refused(make: type[NES] | type[Search], costs: list[float], text: str) -> None:
    es = make([0.0], 1.0)
    es.ask()
    with pytest.raises(InvalidValue, match=text):
        es.tell(costs)
