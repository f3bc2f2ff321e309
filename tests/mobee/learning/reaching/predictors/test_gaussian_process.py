# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.predictors import gaussian_process
from mobee.learning.reaching.predictors.covariance import Covariance, LinearArm, default_parameters, joint_squares, points, scales_of
from mobee.learning.reaching.predictors.gaussian_process import BLOCK, GaussianProcess, thinned
from mobee.learning.reaching.predictors.predictor import Reached
from tests.mobee.learning.reaching.predictors.arms import FAR, drawn, places, reaches, taught


def dense(made, seen, target, logs):
    """Mean and covariance from all reaches at once, repeats as rows of their own."""
    covariance, arm, states = Covariance(joint_squares(made), logs), LinearArm(made), np.arange(len(made))
    state, where, value = (np.array(column) for column in zip(*seen, strict=True))
    data, asked = points(arm, state, where), points(arm, states, target)
    inverse = np.linalg.inv(covariance.between(data, data) + covariance.noise * np.eye(len(seen)))
    cross = covariance.between(data, asked)
    mean = arm.rewards(states, target) + cross.T @ inverse @ (value - arm.rewards(state, where))
    return mean, covariance.between(asked, asked) - cross.T @ inverse @ cross


@pytest.mark.parametrize("tries", [1, BLOCK - 1, BLOCK, BLOCK + 1, 5 * BLOCK + 3])
def test_mean_and_deviation_are_those_of_the_dense_posterior(tries):
    made, seen = reaches(), drawn(reaches(), tries)
    process = taught(GaussianProcess(made, refits=()), seen)
    for target in (*places()[:2], np.array([0.05, 0.0, -0.1])):
        mean, covariance = dense(made, seen, target, default_parameters(made))
        np.testing.assert_allclose(process.mean(target), mean, rtol=0, atol=1e-10)
        np.testing.assert_allclose(process.deviation(target), np.sqrt(covariance.diagonal()), rtol=0, atol=1e-8)


def test_merging_repeats_changes_nothing(monkeypatch):
    made, seen = reaches(), drawn(reaches(), 200)
    monkeypatch.setattr(gaussian_process, "REPEATS", 20)
    process = taught(GaussianProcess(made, refits=()), seen)
    mean, covariance = dense(made, seen, places()[0], default_parameters(made))
    np.testing.assert_allclose(process.mean(places()[0]), mean, rtol=0, atol=1e-10)
    np.testing.assert_allclose(process.deviation(places()[0]), np.sqrt(covariance.diagonal()), rtol=0, atol=1e-8)


def test_targets_forgotten_in_memory_are_worked_out_again(monkeypatch):
    made, seen = reaches(), drawn(reaches(), 100)
    other = taught(GaussianProcess(made, refits=()), seen)
    expected = [other.mean(target) for target in places()]
    monkeypatch.setattr("mobee.learning.reaching.predictors.gaussian_process.MAX_CACHE", 80e3)
    process = taught(GaussianProcess(made, refits=()), seen)
    for _ in range(2):
        for target, mean in zip(places(), expected, strict=True):
            np.testing.assert_array_equal(process.mean(target), mean)
    assert len(process._posterior._queries) < len(places())


def test_a_record_taken_in_at_once_is_one_learned_reach_by_reach():
    made, seen = reaches(), drawn(reaches(), 100)
    at_once, one_by_one = (GaussianProcess(made, refits=(30, 60)) for _ in range(2))
    taught(at_once, seen)
    for state, target, reward in seen:
        one_by_one.mean(target)
        one_by_one.add(state, target, reward, 0.0)
    for target in places():
        np.testing.assert_array_equal(at_once.mean(target), one_by_one.mean(target))
        np.testing.assert_array_equal(at_once.deviation(target), one_by_one.deviation(target))


@pytest.mark.parametrize(("targets", "kept"), [(3.5, 3), (0.5, 1)])
def test_what_is_kept_of_targets_is_bounded_by_its_bytes(monkeypatch, targets, kept):
    made = reaches()
    process = GaussianProcess(made, refits=())
    process.mean(places()[0])
    (one,) = process._posterior._queries.values()
    monkeypatch.setattr(
        "mobee.learning.reaching.predictors.gaussian_process.MAX_CACHE", targets * (one.rows.nbytes + 2 * one.covariance.nbytes)
    )
    for distance in range(6):
        process.mean(np.array([distance, 0.0, 0.0]))
    assert len(process._posterior._queries) == kept


def test_no_data_is_the_prior_and_so_is_what_lies_far_from_all_data_but_for_what_all_rewards_share():
    made = reaches()
    fresh = GaussianProcess(made)
    covariance = Covariance(joint_squares(made), default_parameters(made))
    np.testing.assert_allclose(fresh.mean(places()[0]), LinearArm(made).rewards(np.arange(len(made)), places()[0]))
    np.testing.assert_allclose(fresh.deviation(places()[0]), np.sqrt(covariance.prior))
    process = taught(GaussianProcess(made, refits=()), drawn(made, 100))
    far = process.mean(FAR) - LinearArm(made).rewards(np.arange(len(made)), FAR)
    np.testing.assert_allclose(far, np.full(len(made), far[0]), rtol=0, atol=1e-9)
    own = covariance.prior - 0.3**2
    assert (process.deviation(FAR) ** 2 > own).all()
    assert (process.deviation(FAR) ** 2 < covariance.prior).all()


def test_a_fit_makes_the_rewards_more_likely_and_predictions_better():
    made, seen = reaches(0, 24), drawn(reaches(0, 24), 60, targets=12)
    held = drawn(made, 300, seed=0, targets=12, noise=0.0)
    errors = []
    for refits in ((), (60,)):
        process = taught(GaussianProcess(made, refits), seen)
        errors.append(np.mean([(process.mean(target)[state] - value) ** 2 for state, target, value in held]))
    assert errors[1] < 0.8 * errors[0]


def test_any_number_of_targets_is_learned_from_in_bounded_memory(monkeypatch):
    made, rng = reaches(), np.random.default_rng(3)
    monkeypatch.setattr(gaussian_process, "MAX_PAIRS", 60)
    monkeypatch.setattr(gaussian_process, "REPEATS", 20)
    process = GaussianProcess(made, refits=())
    for _ in range(400):
        process.add(int(rng.integers(len(made))), rng.uniform(-0.2, 0.2, 3), float(rng.random()), 0.0)
        assert len(process._posterior) <= 80
    assert np.isfinite(process.mean(np.zeros(3))).all()


def test_thinned_keeps_all_tries_their_average_reward_and_their_middle():
    known, rng = Reached(), np.random.default_rng(1)
    for _ in range(300):
        known.add(int(rng.integers(4)), rng.uniform(-0.2, 0.2, 3), float(rng.random()))
    state, target, mean, count, _ = thinned(known, 40)
    assert len(state) <= 40
    assert count.sum() == 300
    assert count @ mean == pytest.approx(known.count @ known.mean)
    np.testing.assert_allclose(count @ target, known.places[known.target].sum(axis=0))
    assert [count[state == s].sum() for s in range(4)] == [(known.state == s).sum() for s in range(4)]


def test_thinned_keeps_a_pair_of_every_state_where_there_are_more_states_than_pairs_wanted():
    known, rng = Reached(), np.random.default_rng(2)
    for number in range(200):
        known.add(number % 50, rng.uniform(-0.2, 0.2, 3), float(rng.random()))
    state, _, _, count, _ = thinned(known, 40)
    assert sorted(state) == list(range(50))
    assert count.tolist() == [4.0] * 50


def test_thinned_leaves_few_pairs_as_they_are():
    known = Reached()
    for state, target, value in drawn(reaches(), 50):
        known.add(state, target, value)
    state, target, mean, count, world = thinned(known, len(known))
    np.testing.assert_array_equal(state, known.state)
    np.testing.assert_array_equal(world, known.world)
    np.testing.assert_array_equal(target, known.places[known.target])
    np.testing.assert_array_equal(mean, known.mean)
    np.testing.assert_array_equal(count, known.count)


def test_reaches_in_two_worlds_with_the_same_target_stay_two_pairs_when_pairs_are_merged():
    known = Reached()
    for world in (0, 1):
        for number in range(30):
            known.add(2, np.full(3, 0.0001 * number), 0.1 + 0.8 * world, world)
    state, _, mean, count, world = thinned(known, 10)
    assert (state.tolist(), world.tolist()) == ([2, 2], [0, 1])
    np.testing.assert_allclose(mean, [0.1, 0.9])
    assert count.tolist() == [30.0, 30.0]


def elsewhere(seen, shift, rng):
    """The same reaches in another world, where each state has rewards of its own."""
    own = rng.normal(0.0, shift, 1 + max(state for state, _, _ in seen))
    return [(state, target, reward + own[state]) for state, target, reward in seen]


def test_equal_worlds_are_recognised_and_all_their_rewards_count():
    made, seen = reaches(), drawn(reaches(), 120)
    one, two = (GaussianProcess(made, refits=()) for _ in range(2))
    taught(one, seen)
    taught(two, seen[:80])
    two.begin_world()
    taught(two, seen[80:])
    assert two._factors.tolist() == [0.0, 0.0]
    for target in places():
        np.testing.assert_allclose(two.mean(target), one.mean(target), rtol=0, atol=1e-6)


def test_rewards_of_another_world_count_less_than_those_of_this_one():
    made, rng = reaches(0, 24), np.random.default_rng(5)
    seen, held = drawn(made, 60, targets=12), drawn(made, 300, seed=0, targets=12, noise=0.0)
    other = elsewhere(drawn(made, 300, seed=7, targets=12), 0.4, rng)
    errors = {}
    for name, before, here in (
        ("one world", other, []),
        ("compared", other, seen),
        ("not compared", [*other, *seen], []),
        ("alone", [], seen),
    ):
        process = taught(GaussianProcess(made), before)
        if here:
            process.begin_world()
            taught(process, here)
        errors[name] = np.sqrt(np.mean([(process.mean(target)[state] - value) ** 2 for state, target, value in held]))
    assert errors["compared"] < 0.5 * errors["not compared"]
    assert errors["compared"] < 1.1 * errors["alone"]


def test_mean_and_deviation_after_a_change_are_those_of_the_dense_posterior_in_both_worlds():
    made, seen = reaches(), drawn(reaches(), 90)
    worlds = np.repeat([0, 1], [60, 30])
    process = taught(GaussianProcess(made, refits=()), elsewhere(seen[:60], 0.5, np.random.default_rng(0)))
    process.begin_world()
    taught(process, seen[60:])
    made_here = [*elsewhere(seen[:60], 0.5, np.random.default_rng(0)), *seen[60:]]
    assert process._factors[0] > 0.0
    covariance, arm, states = Covariance(joint_squares(made), default_parameters(made)), LinearArm(made), np.arange(len(made))
    state, where, value = (np.array(column) for column in zip(*made_here, strict=True))
    data, asked = points(arm, state, where), points(arm, states, places()[0])
    matrix = covariance.between(data, data) * scales_of(worlds, process._factors) + covariance.noise * np.eye(len(seen))
    cross = np.linalg.solve(matrix, covariance.between(data, asked))
    mean = arm.rewards(states, places()[0]) + cross.T @ (value - arm.rewards(state, where))
    variance = (covariance.between(asked, asked) - covariance.between(asked, data) @ cross).diagonal()
    np.testing.assert_allclose(process.mean(places()[0]), mean, rtol=0, atol=1e-9)
    np.testing.assert_allclose(process.deviation(places()[0]), np.sqrt(variance), rtol=0, atol=1e-8)


def test_a_world_without_reaches_changes_no_prediction():
    made, seen = reaches(), drawn(reaches(), 50)
    process, fresh = taught(GaussianProcess(made), seen), GaussianProcess(made)
    before = process.mean(places()[0])
    for one in (process, fresh):
        one.begin_world()
        one.begin_world()
    np.testing.assert_allclose(process.mean(places()[0]), before, rtol=0, atol=1e-9)
    np.testing.assert_allclose(fresh.mean(places()[0]), GaussianProcess(made).mean(places()[0]))
