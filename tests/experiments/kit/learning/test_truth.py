# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from experiments.kit.learning.outcomes import Truth, l1, model_error, most_likely, sampling_error, truth_of, walk
from mobee.learning.tabular import TabularPlant, half_space
from tests.mobee.learning.toys import arm

SPACE = arm(neighbours="equidistant")


def plant_of(seed):
    return TabularPlant(SPACE, *half_space(SPACE), seed)


def test_a_walk_tries_every_action_often_enough_and_begins_where_it_ended():
    seen = walk(SPACE, plant_of, tries=3, most=20_000, seed=0)
    tries = np.zeros(SPACE.goals.shape)
    np.add.at(tries, (seen[:, 0], seen[:, 1]), 1)
    assert tries[SPACE.goals >= 0].min() == 3
    assert np.array_equal(seen[1:, 0], seen[:-1, 2])


def test_the_truth_is_the_frequencies_of_observed_outcomes():
    truth = truth_of(SPACE, np.array([[0, 0, 1], [0, 0, 1], [0, 0, 40], [80, 3, 0], [0, 1, 1]]))
    assert truth.tries.sum() == 5 and truth.tries[0, 0] == 3 and truth.tries[80, 3] == 1
    assert dict(zip(truth.outcomes[0, 0], truth.probabilities[0, 0], strict=True)) == pytest.approx({1: 2 / 3, 40: 1 / 3})
    assert truth.outcomes[80, 3, 0] == 0 and truth.probabilities[80, 3].tolist() == [1, 0]
    assert truth.probabilities.sum() == pytest.approx(3)


def test_walks_of_several_seeds_find_the_table_that_the_plant_draws_from():
    truth = truth_of(SPACE, np.concatenate([walk(SPACE, plant_of, tries=25, most=40_000, seed=seed) for seed in (1, 2)]))
    error = l1(truth, plant_of(0))
    assert truth.tries[SPACE.goals >= 0].min() >= 50
    stochastic = plant_of(0).probabilities.max(axis=-1) < 1
    stochastic &= SPACE.goals >= 0
    assert (error[(SPACE.goals >= 0) & ~stochastic] == 0).all()
    assert error[stochastic].mean() < 0.3  # about 9 outcomes and 60 tries each


@dataclass
class Table:
    outcomes: np.ndarray
    probabilities: np.ndarray


TRUTH = Table(np.array([[[0, 1], [1, 0]], [[1, 0], [0, 0]]]), np.array([[[1.0, 0.0], [0.5, 0.5]], [[0.95, 0.05], [0.0, 0.0]]]))


@st.composite
def tables(draw):
    """Any bins, several of them of one state."""
    bins = draw(st.integers(1, 5))
    rng = np.random.default_rng(draw(st.integers(0, 9999)))
    weights = rng.random((3, 2, bins)) * (rng.random((3, 2, bins)) < 0.7)
    return Table(rng.integers(0, 3, (3, 2, bins)), weights / np.maximum(weights.sum(axis=-1, keepdims=True), 1e-300))


def dense(table):
    full = np.zeros((3, 2, 3))
    np.add.at(full, (*np.ogrid[:3, :2, :1][:2], table.outcomes), table.probabilities)
    return full


@given(tables(), tables())
def test_l1_is_that_of_the_dense_distributions(beliefs, truth):
    expected = np.abs(dense(beliefs) - dense(truth)).sum(axis=-1)
    known = truth.probabilities.any(axis=-1)
    found = l1(beliefs, truth)
    assert found[known] == pytest.approx(expected[known])
    assert np.isnan(found[~known]).all()


def test_the_truth_has_no_error_and_the_order_of_bins_does_not_matter():
    swapped = Table(TRUTH.outcomes[:, :, ::-1], TRUTH.probabilities[:, :, ::-1])
    assert l1(swapped, TRUTH)[:, 0] == pytest.approx([0, 0])
    assert np.isnan(l1(TRUTH, TRUTH)[1, 1])


def test_the_error_is_returned_for_all_and_for_stochastic_actions():
    beliefs = Table(np.zeros((2, 2, 1), dtype=int), np.ones((2, 2, 1)))  # all end in state 0
    overall, stochastic = model_error(beliefs, TRUTH)
    assert overall == pytest.approx((0.0 + 1.0 + 1.9) / 3)
    assert stochastic == pytest.approx(1.0)
    assert most_likely(TRUTH)[0, 1] == 0.5


def test_the_error_of_measured_outcomes_is_that_of_a_second_measurement():
    rng, tries, p = np.random.default_rng(0), 40, np.array([0.5, 0.3, 0.2])
    truth = Truth(np.zeros((1, 2, 3), dtype=int), np.array([[p, np.zeros(3)]]), np.array([[tries, 0]]))
    drawn = np.abs(rng.multinomial(tries, p, size=4000) / tries - p).sum(axis=1).mean()
    expected = sampling_error(truth)
    assert expected[0, 0] == pytest.approx(drawn, rel=0.03) and np.isnan(expected[0, 1])
