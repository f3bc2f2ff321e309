"""Other solvers of the same decision problem: SciPy's sparse matrices in a loop, and quantecon's DiscreteDP.

Both get the problem as they like it, made before anything is timed: one sparse matrix of all state-actions.  Of quantecon's
methods the exact one, policy iteration, is left out: between actions that are equal but for rounding it does not settle.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.sparse import csr_matrix

from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.learning.value_iteration import OutcomeModel

QUANTECON = {"value_iteration": "quantecon value iteration", "modified_policy_iteration": "quantecon modified policy iteration"}


class QuanteconMissing(MobeeError):
    """Raised when the benchmark is asked for and quantecon is not installed."""


def load_quantecon() -> Any:
    """Its class DiscreteDP; raises QuanteconMissing."""
    try:
        from quantecon.markov import DiscreteDP
    except ImportError:
        raise QuanteconMissing("quantecon is not installed: pip install '.[bench]' in MoBeE's folder") from None
    return DiscreteDP


class Problem:
    """A decision problem in which every state has an action, as rows: the rewards (N,) and next states (N, S) of all state-actions.

    Args:
        model, reward, discount, tolerance: as of `mobee.value_iteration`.
    """

    def __init__(self, model: OutcomeModel, reward: Array, discount: float, tolerance: float) -> None:
        self.discount, self.tolerance = discount, tolerance
        self.states, self.actions = np.nonzero(reward != -np.inf)
        self.rewards = np.ascontiguousarray(reward[self.states, self.actions])
        self.first = np.searchsorted(self.states, np.arange(len(reward)))
        weights, following = model.probabilities[self.states, self.actions], model.outcomes[self.states, self.actions]
        rows = np.repeat(np.arange(len(self.rewards)), weights.shape[1])
        self.following = csr_matrix((weights.ravel(), (rows, following.ravel())), shape=(len(self.rewards), len(reward)))
        self.following.eliminate_zeros()

    def scipy_values(self) -> Array:
        """State values (S,) by Algorithm 7, a sparse product a sweep."""
        values, before = np.zeros(len(self.first)), np.zeros(len(self.rewards))
        while True:
            action_values = self.rewards + self.discount * (self.following @ values)
            values = np.maximum.reduceat(action_values, self.first)
            if np.abs(action_values - before).max() < self.tolerance:
                return values
            before = action_values

    def quantecon(self) -> Any:
        """The problem as quantecon's object."""
        return load_quantecon()(self.rewards, self.following, self.discount, self.states, self.actions)

    def quantecon_values(self, problem: Any, method: str) -> Array:
        """State values (S,) by quantecon from its own start, which is nearer than zero; its value iteration stops by our rule."""
        epsilon = 2.0 * self.discount / (1.0 - self.discount) * self.tolerance
        values: Array = problem.solve(method=method, epsilon=epsilon, max_iter=100_000).v
        return values
