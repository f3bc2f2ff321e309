from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import value_iteration
from tests.mobee.learning.toys import arm


@dataclass
class Table:
    """A model given by its tables."""

    outcomes: np.ndarray
    probabilities: np.ndarray


def policy_iteration(model, reward, discount):
    """The oracle: dense matrices, exact linear solves."""
    states, actions, _ = model.outcomes.shape
    dense = np.zeros((states, actions, states))
    np.add.at(dense, (*np.ogrid[:states, :actions, :1][:2], model.outcomes), model.probabilities)
    policy = reward.argmax(axis=1)
    while True:
        rows = np.arange(states)
        v = np.linalg.solve(np.eye(states) - discount * dense[rows, policy], reward[rows, policy])
        q = np.where(reward == -np.inf, -np.inf, reward + discount * dense @ v)
        better = q.max(axis=1) > q[rows, policy] + 1e-13
        if not better.any():
            return v, q
        policy = np.where(better, q.argmax(axis=1), policy)


def experienced(neighbours, seed, transitions=400):
    model = TransitionModel(arm(neighbours=neighbours))
    rng = np.random.default_rng(seed)
    for _ in range(transitions):
        s = int(rng.integers(81))
        model.observe(s, int(rng.integers(len(model.space.actions(s)))), int(rng.integers(81)))
    return model


@pytest.mark.parametrize("neighbours", [16, "equidistant"])
@pytest.mark.parametrize("discount", [0.0, 0.5, 0.9, 0.99])
@pytest.mark.parametrize("sign", [1, -1])
def test_values_are_those_of_exact_policy_iteration(neighbours, discount, sign):
    model = experienced(neighbours, seed=1)
    reward = np.where(model.reward == -np.inf, -np.inf, sign * model.reward)
    v, q = value_iteration(model, reward, discount, tolerance=1e-12)
    exact_v, exact_q = policy_iteration(model, reward, discount)
    assert np.abs(v - exact_v).max() < 1e-9
    assert np.array_equal(q == -np.inf, reward == -np.inf)
    finite = np.isfinite(q)
    assert np.abs(q[finite] - exact_q[finite]).max() < 1e-9
    assert np.array_equal(v, q.max(axis=1))


def chain():
    """Six states in a row, one action a state: on to the next; the last stays."""
    following = np.minimum(np.arange(6) + 1, 5)
    return Table(following[:, None, None], np.ones((6, 1, 1))), np.array([[-1.0]] * 5 + [[0.0]])


def test_negative_rewards_spread_along_the_chain():
    v, _ = value_iteration(*chain())
    assert v == pytest.approx([-4.0951, -3.439, -2.71, -1.9, -1, 0], abs=1e-9)


def test_values_fall_after_a_warm_start_when_a_reward_fell():
    model, reward = chain()
    high = np.zeros((6, 1))
    high[5] = 1.0
    before, _ = value_iteration(model, high, tolerance=1e-12)
    after, _ = value_iteration(model, 0.1 * high, tolerance=1e-12, start=before)
    assert after == pytest.approx(0.1 * before, abs=1e-9)
    assert before[5] == pytest.approx(10.0)


def test_a_warm_start_finds_the_same_values():
    model = experienced("equidistant", seed=2)
    cold, _ = value_iteration(model, model.reward, tolerance=1e-12)
    warm, _ = value_iteration(model, model.reward, tolerance=1e-12, start=np.random.default_rng(0).normal(size=81))
    assert warm == pytest.approx(cold, abs=1e-9)


def test_a_cold_start_whose_rewards_are_all_below_the_tolerance_stops_after_one_sweep():
    model, _ = chain()
    v, _ = value_iteration(model, np.full((6, 1), 1e-4))
    assert v == pytest.approx(np.full(6, 1e-4))


def test_it_ends_with_values_too_large_for_the_tolerance():
    model = experienced(16, seed=3)
    v, _ = value_iteration(model, 1e9 * model.reward, tolerance=1e-12)
    assert v == pytest.approx(1e9 * value_iteration(model, model.reward, tolerance=1e-12)[0], rel=1e-9)


def test_minus_infinity_takes_an_action_out_and_a_state_without_actions_keeps_its_start():
    model, reward = chain()
    reward[5] = -np.inf
    v, q = value_iteration(model, reward, start=np.array([0, 0, 0, 0, 0, 7.0]), tolerance=1e-12)
    assert v[5] == 7.0 and q[5, 0] == -np.inf
    assert v[4] == pytest.approx(-1 + 0.9 * 7)


def test_entries_without_an_action_are_ignored():
    model = TransitionModel(arm(neighbours="equidistant"))
    everywhere, _ = value_iteration(model, np.ones((81, 8)))
    only_actions, _ = value_iteration(model, np.where(model.space.goals == -1, -np.inf, 1.0))
    assert np.array_equal(everywhere, only_actions)


@pytest.mark.parametrize(
    "options",
    [
        {"discount": 1.0},
        {"discount": -0.1},
        {"tolerance": 0.0},
        {"reward": np.zeros(6)},
        {"reward": np.full((6, 1), np.nan)},
        {"reward": np.full((6, 1), np.inf)},
        {"start": np.zeros(5)},
    ],
)
def test_arguments_out_of_range_are_refused(options):
    model, reward = chain()
    with pytest.raises(InvalidValue, match="valid|give"):
        value_iteration(model, **({"reward": reward} | options))
