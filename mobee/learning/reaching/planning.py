"""Plans that end in a reach: a further action of every state, after which the episode ends (thesis 8.2, 8.3.1)."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel, value_iteration

REACH = -1  # the reach action of a state, on record and among its action values
TOLERANCE = 1e-6  # of values; the largest are about 1


class ReachPlanning:
    """Values of states and actions when every state can end the plan with a reach.

    Args:
        space: states and transitions.
        beliefs: where transitions lead.
        discount: a factor a step, in [0, 1).
    """

    def __init__(self, space: Space, beliefs: OutcomeModel, discount: float) -> None:
        self.discount, self._beliefs = discount, beliefs
        self._states, self._actions = space.goals.shape
        self._reward: Array = np.full((self._states + 1, self._actions + 1), -np.inf)
        self.refresh()

    @property
    def outcomes(self) -> Ints:
        """States that each action may reach, shape (S + 1, A + 1, B): the last state is the end, the last action the reach."""
        return self._outcomes

    @property
    def probabilities(self) -> Array:
        """Their probabilities, shape (S + 1, A + 1, B), none in the end."""
        return self._probabilities

    def refresh(self) -> None:
        """Take over what the beliefs say now."""
        states, actions = self._states, self._actions
        bins = self._beliefs.probabilities.shape[2]
        self._outcomes: Ints = np.full((states + 1, actions + 1, bins), states, dtype=np.int64)
        self._probabilities: Array = np.zeros(self._outcomes.shape)
        self._outcomes[:states, :actions] = self._beliefs.outcomes
        self._probabilities[:states, :actions] = self._beliefs.probabilities
        self._probabilities[:states, actions, 0] = 1.0

    def values(self, reaches: Array, moves: Array | float) -> tuple[Array, Array]:
        """V (S,) and Q (S, A + 1), of which the last column is the reach's.

        `reaches`: (S,) what reaching is worth, -inf where it may not be.  `moves`: (S, A) rewards of the transitions.
        """
        self._reward[:-1, :-1], self._reward[:-1, -1] = moves, reaches
        start = np.append(np.where(reaches == -np.inf, 0.0, reaches), 0.0)  # to reach at once is a policy too
        values, action_values = value_iteration(self, self._reward, self.discount, TOLERANCE, start, method="modified")
        return values[:-1], action_values[:-1]
