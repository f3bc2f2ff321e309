"""The value of being in each state and of each action there (thesis Algorithm 7)."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Protocol

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Ints


class OutcomeModel(Protocol):
    """Where actions lead: what a plan needs of a transition model."""

    @property
    def outcomes(self) -> Ints:
        """States reached, shape (S, A, B)."""

    @property
    def probabilities(self) -> Array:
        """Their probabilities, shape (S, A, B), all 0 where a state has no such action."""


def value_iteration(
    model: OutcomeModel, reward: Array, discount: float = 0.9, tolerance: float = 1e-3, start: Array | None = None
) -> tuple[Array, Array]:
    """Values V (S,) and Q (S, A) of the greedy policy by Jacobi sweeps (thesis Algorithm 7).

    The sweeps stop when no action value changed by `tolerance` or more.  The thesis prints the change without its
    absolute value, which stops at once when values have to fall (negative rewards, a warm start after a reward decayed).

    Args:
        model: the outcomes of the actions; a state without actions keeps its starting value.
        reward: (S, A); -inf takes an action out of the plan, entries without an action are ignored.
        discount: in [0, 1).
        tolerance: above 0, in the unit of the reward; the values are within tolerance * discount / (1 - discount) of the limit.
        start: (S,) values to start from, zero if None.

    Returns:
        V and Q, with Q = -inf where there is no action.
    """
    probabilities, outcomes = model.probabilities, model.outcomes
    if not (0.0 <= discount < 1.0 and tolerance > 0.0):
        raise InvalidValue(f"discount={discount!r}, tolerance={tolerance!r}: valid are 0 <= discount < 1 and tolerance > 0.")
    if np.shape(reward) != outcomes.shape[:2]:
        raise InvalidValue(f"reward has shape {np.shape(reward)}: give one value for each state and action, shape {outcomes.shape[:2]}.")
    values = np.zeros(len(outcomes)) if start is None else np.array(start, dtype=np.float64)
    if values.shape != (len(outcomes),) or not np.isfinite(values).all():
        raise InvalidValue(f"start has shape {values.shape} or is not finite: give one value for each of the {len(outcomes)} states.")
    wrong = ~(np.isfinite(reward) | (reward == -np.inf))
    if wrong.any() and (wrong & probabilities.any(axis=-1)).any():
        raise InvalidValue("reward holds NaN or +inf: valid are finite values, and -inf to take an action out of the plan.")
    given = (np.array(x, dtype=t, order="C") for x, t in ((probabilities, np.float64), (outcomes, np.int64), (reward, np.float64)))
    action_values: Array = _sweeps().sweep(*given, values, discount, tolerance)
    return values, action_values


@cache
def _sweeps() -> ModuleType:
    """The compiled sweeps, imported when they are first needed, after the whole engine: a process compiles all at once, or nothing."""
    from mobee.engine.load import load

    load()
    from mobee.learning import sweeps

    return sweeps
