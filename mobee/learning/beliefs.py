# SPDX-License-Identifier: Apache-2.0
"""The probability and the surprise of an outcome in a learner's model, and when a learner can predict the outcome of an action."""

from __future__ import annotations

import math

from mobee.learning.value_iteration import OutcomeModel

LEAST_PROBABILITY = 1e-3  # surprise of an outcome that the agent held impossible: that of this probability
PREDICTABLE_TRIES = 2
PREDICTABLE_SHARE = 0.8
"""A state-action is predictable if it was tried at least PREDICTABLE_TRIES (2) times, and this share of the tries had the same outcome."""


def probability_of(beliefs: OutcomeModel, s: int, a: int, outcome: int) -> float:
    """Return the probability, in the model `beliefs`, that action `a` in state `s` ends in the state `outcome`.

    It is 0 for a state that the model does not list as an outcome of the action.
    """
    return float(beliefs.probabilities[s, a][beliefs.outcomes[s, a] == outcome].sum())


def surprise_of(probability: float) -> float:
    """Return the surprise -ln p of an outcome of probability p, in nats; a p below LEAST_PROBABILITY (0.001) counts as this value."""
    return -math.log(max(probability, LEAST_PROBABILITY))
