# SPDX-License-Identifier: Apache-2.0
"""What every predictor of rewards does, whatever its mathematics."""

from __future__ import annotations

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors import PREDICTORS
from tests.mobee.learning.reaching.predictors.arms import FAR, TARGETS, drawn, places, reaches, reward, taught

UNSURE = [name for name in PREDICTORS if name != "weighted"]  # these say how sure they are
BY_DATA = [name for name in PREDICTORS if name != "networks"]  # what these predict does not depend on the order of the reaches


@pytest.mark.parametrize("name", PREDICTORS)
def test_settings_name_the_predictor_and_are_plain_json(name):
    settings = PREDICTORS[name](reaches()).settings
    assert settings["name"] == name
    assert json.loads(json.dumps(settings)) == settings


@pytest.mark.parametrize("name", [name for name in BY_DATA if name not in ("kernel_prior", "gp")])
def test_without_data_all_states_are_expected_to_bring_the_same(name):
    predictor = PREDICTORS[name](reaches())
    here, there = predictor.mean(places()[0]), predictor.mean(places()[1])
    np.testing.assert_allclose(here, np.full(12, here[0]))
    np.testing.assert_array_equal(here, there)


@pytest.mark.parametrize("name", UNSURE)
def test_what_was_tried_often_is_known_better_than_what_was_not(name):
    made, where = reaches(), places()
    predictor = taught(PREDICTORS[name](made), drawn(made, 40))
    before = predictor.deviation(where[0]).mean()
    taught(predictor, [(state, where[0], reward(made, state, where[0])) for state in range(12)] * 15)
    assert predictor.deviation(where[0]).mean() < before
    np.testing.assert_allclose(predictor.mean(where[0]), [reward(made, state, where[0]) for state in range(12)], atol=0.2)


@pytest.mark.parametrize("name", UNSURE)
def test_draws_have_the_predicted_mean_and_deviation(name):
    made, where = reaches(), places()
    predictor, rng = taught(PREDICTORS[name](made), drawn(made, 25)), np.random.default_rng(0)
    samples = np.stack([predictor.sample(where[2], rng) for _ in range(4000)])
    deviation = predictor.deviation(where[2])
    np.testing.assert_array_less(np.abs(samples.mean(axis=0) - predictor.mean(where[2])), 5.0 * deviation / np.sqrt(4000))
    np.testing.assert_allclose(samples.std(axis=0), deviation * (np.sqrt(0.8) if name == "networks" else 1.0), rtol=0.1)


@pytest.mark.parametrize("name", PREDICTORS)
def test_asking_changes_nothing_and_the_same_reaches_make_the_same_predictor_to_the_bit(name):
    made, where = reaches(), places()
    quiet, asked = PREDICTORS[name](made), PREDICTORS[name](made)
    rng = np.random.default_rng(5)
    for number, (state, target, value) in enumerate(drawn(made, 150)):
        for _ in range(number % 3):
            asked.mean(where[rng.integers(TARGETS)])
        if number % 7 == 0:
            asked.mean(rng.uniform(-0.2, 0.2, 3))
        for one in (quiet, asked):
            one.add(state, target, value, 0.0)
    for target in (*where, np.zeros(3)):
        np.testing.assert_array_equal(quiet.mean(target), asked.mean(target))
        if name in UNSURE:
            np.testing.assert_array_equal(quiet.sample(target, np.random.default_rng(1)), asked.sample(target, np.random.default_rng(1)))


@pytest.mark.parametrize("name", BY_DATA)
@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6))
def test_the_order_of_the_reaches_does_not_matter(name, seed):
    made, seen = reaches(), drawn(reaches(), 22, seed)  # after 22 reaches the kernels choose their scales
    mixed = [seen[i] for i in np.random.default_rng(seed).permutation(len(seen))]
    one, other = taught(PREDICTORS[name](made), seen), taught(PREDICTORS[name](made), mixed)
    for target in (*places(seed)[:2], np.zeros(3)):
        np.testing.assert_allclose(one.mean(target), other.mean(target), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", ["table", "kernel", "nearest"])
def test_a_target_far_from_all_others_is_expected_to_be_like_the_average_and_known_as_little_as_ever(name):
    made = reaches()
    fresh, predictor = PREDICTORS[name](made), taught(PREDICTORS[name](made), drawn(made, 100))
    far = predictor.mean(FAR)
    np.testing.assert_allclose(far, np.full(12, far[0]), atol=1e-6)
    assert abs(far[0] - np.mean([value for _, _, value in drawn(made, 100)])) < 0.1
    assert (predictor.deviation(FAR) >= predictor.deviation(places()[0]) - 1e-12).all()
    assert np.isfinite(fresh.deviation(FAR)).all()


@pytest.mark.parametrize("name", PREDICTORS)
def test_writing_into_a_returned_mean_changes_nothing(name):
    made = reaches()
    predictor = taught(PREDICTORS[name](made), drawn(made, 10))
    copy = predictor.mean(places()[0])
    copy += 1.0
    np.testing.assert_allclose(predictor.mean(places()[0]) + 1.0, copy)


def test_the_published_predictor_says_that_it_has_no_deviation():
    predictor = PREDICTORS["weighted"](reaches())
    with pytest.raises(InvalidValue, match="no deviation"):
        predictor.deviation(places()[0])


@pytest.mark.parametrize("name", UNSURE)
def test_more_reaches_bring_predictions_nearer_to_the_truth_than_the_average_is(name):
    made, where = reaches(), places()
    predictor = taught(PREDICTORS[name](made), drawn(made, 150))
    truth = np.array([[reward(made, state, target) for state in range(12)] for target in where])
    error = np.array([predictor.mean(target) for target in where]) - truth
    assert np.sqrt((error**2).mean()) < 0.5 * truth.std()
