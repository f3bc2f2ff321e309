"""Exact values by policy iteration: what value iteration is checked against."""

from __future__ import annotations

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.value_iteration import BAD_REWARD, OutcomeModel, tables
from mobee.robot.robot import Array, Ints

_EQUAL = 1e-13  # of the largest value: a better action is better by more


def policy_iteration(model: OutcomeModel, reward: Array, discount: float = 0.9) -> tuple[Array, Array]:
    """Values V (S,) and Q (S, A) of the greedy policy, each policy evaluated by a sparse linear solve (Howard 1960).

    Exact but for rounding.  Arguments and what comes back are as of `value_iteration`; a state without actions is worth 0.
    Raises InvalidValue with what is valid.
    """
    probabilities, outcomes, reward = tables(model, reward, discount)
    exists = probabilities.any(axis=-1) & (reward != -np.inf)
    if not np.isfinite(reward[exists]).all():
        raise InvalidValue(BAD_REWARD)
    rewards = np.where(exists, reward, -np.inf)
    acting = np.flatnonzero(exists.any(axis=1))
    policy = rewards.argmax(axis=1)
    while True:
        values = _evaluate(probabilities, outcomes, rewards, discount, acting, policy)
        action_values = rewards + discount * (probabilities * values[outcomes]).sum(axis=-1)
        margin = _EQUAL * np.abs(values).max(initial=0.0)
        best, current = action_values[acting].max(axis=1, initial=-np.inf), action_values[acting, policy[acting]]
        better = acting[best > current + margin]
        if not len(better):
            return values, action_values
        policy[better] = action_values[better].argmax(axis=1)


def _evaluate(probabilities: Array, outcomes: Ints, rewards: Array, discount: float, acting: Ints, policy: Ints) -> Array:
    """The values of following a policy for ever: V = R + discount P V in the states that act, 0 elsewhere."""
    from scipy.sparse import csc_array, eye_array
    from scipy.sparse.linalg import spsolve

    states, bins = len(outcomes), outcomes.shape[2]
    taken = policy[acting]
    weights, following = discount * probabilities[acting, taken], outcomes[acting, taken]
    onwards = csc_array((weights.ravel(), (np.repeat(acting, bins), following.ravel())), shape=(states, states))
    immediate = np.zeros(states)
    immediate[acting] = rewards[acting, taken]
    values: Array = spsolve((eye_array(states) - onwards).tocsc(), immediate)
    return values
