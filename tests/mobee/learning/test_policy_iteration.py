from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import InvalidValue
from mobee.learning.value_iteration import policy_iteration
from tests.mobee.learning.tables import chain, random_problem


def dense_policy_iteration(model, reward, discount):
    """The oracle: dense matrices, each state without actions an absorbing one that pays nothing."""
    states, actions, _ = model.outcomes.shape
    moves = np.zeros((states, actions, states))
    np.add.at(moves, (*np.ogrid[:states, :actions, :1][:2], model.outcomes), model.probabilities)
    reward = np.where(moves.any(axis=-1), reward, -np.inf)
    for s in np.flatnonzero((reward == -np.inf).all(axis=1)):
        moves[s, 0] = 0.0
        reward[s, 0] = 0.0
    rows, policy = np.arange(states), reward.argmax(axis=1)
    for _ in range(100):
        v = np.linalg.solve(np.eye(states) - discount * moves[rows, policy], reward[rows, policy])
        policy = (reward + discount * moves @ v).argmax(axis=1)
    return v


@pytest.mark.parametrize("seed", range(50))
def test_values_are_those_of_dense_solves(seed):
    model, reward, discount = random_problem(seed)
    v, q = policy_iteration(model, reward, discount)
    assert v == pytest.approx(dense_policy_iteration(model, reward, discount), rel=1e-9, abs=1e-9)
    acting = np.isfinite(q).any(axis=1)
    assert v[acting] == pytest.approx(q[acting].max(axis=1), rel=1e-9, abs=1e-9)


def test_the_chain_of_negative_rewards():
    v, _ = policy_iteration(*chain())
    assert v == pytest.approx([-4.0951, -3.439, -2.71, -1.9, -1, 0], abs=1e-12)


def test_a_reward_that_is_no_number_is_refused():
    model, reward = chain()
    reward[2] = np.inf
    with pytest.raises(InvalidValue, match="valid are finite values"):
        policy_iteration(model, reward)
