"""The value of being in each state and of each action there (thesis Algorithm 7)."""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import Literal, Protocol

import numpy as np

from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Array, Ints

METHODS = ("jacobi", "modified")
BAD_REWARD = "reward holds NaN or +inf: valid are finite values, and -inf to take an action out of the plan."


class OutcomeModel(Protocol):
    """Where actions lead: what a plan needs of a transition model."""

    @property
    def outcomes(self) -> Ints:
        """States reached, shape (S, A, B)."""

    @property
    def probabilities(self) -> Array:
        """Their probabilities, shape (S, A, B), all 0 where a state has no such action."""


def value_iteration(
    model: OutcomeModel,
    reward: Array,
    discount: float = 0.9,
    tolerance: float = 1e-3,
    start: Array | None = None,
    relative: bool = False,
    method: Literal["jacobi", "modified"] = "jacobi",
) -> tuple[Array, Array]:
    """Values V (S,) and Q (S, A) of the greedy policy (thesis Algorithm 7).

    The sweeps stop when no value changed by the tolerance or more.  The thesis prints the change without its absolute
    value, which stops at once when values have to fall (negative rewards, a warm start after a reward decayed).

    Args:
        model: the outcomes of the actions; a state without actions keeps its starting value.
        reward: (S, A); -inf takes an action out of the plan, entries without an action are ignored.
        discount: in [0, 1).
        tolerance: above 0; the values are within tolerance * discount / (1 - discount) of the limit.
        start: (S,) values to start from, zero if None.
        relative: the tolerance is in units of the largest |reward| of an action (of 1, if all are 0), else in the reward's own.
        method: "jacobi": Algorithm 7, every sweep looks at all actions, and the values of none may change; "modified": modified
            policy iteration, faster: each such sweep is followed by sweeps over the best action of each state alone, and the
            values of the states may not change.

    Returns:
        V and Q, with Q = -inf where there is no action.

    Raises:
        InvalidValue: with what is valid.
    """
    probabilities, outcomes, reward = tables(model, reward, discount)
    if not tolerance > 0.0:
        raise InvalidValue(f"tolerance={tolerance!r}: valid is a number above 0.")
    values = np.zeros(len(outcomes)) if start is None else np.array(start, dtype=np.float64)
    if values.shape != (len(outcomes),):
        raise InvalidValue(f"start has shape {values.shape}: give one value for each of the {len(outcomes)} states.")
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    sweeps, action_values = load_planning(), np.empty(reward.shape)
    done = sweeps.solve(probabilities, outcomes, reward, values, action_values, discount, tolerance, relative, method == "modified")
    if done == sweeps.BAD_REWARD:
        raise InvalidValue(BAD_REWARD)
    if done == sweeps.BAD_START:
        raise InvalidValue("start holds NaN or an infinity: give finite values.")
    if done == sweeps.BAD_OUTCOME:
        raise InvalidValue(f"the model leads to a state that it does not have: valid are 0 to {len(outcomes) - 1}.")
    return values, action_values


def tables(model: OutcomeModel, reward: Array, discount: float) -> tuple[Array, Ints, Array]:
    """Probabilities (S, A, B), outcomes (S, A, B) and reward (S, A) as the solvers take them, copied only where they are not so yet.

    Raises InvalidValue if the shapes do not fit or the discount is out of range.
    """
    probabilities = np.asarray(model.probabilities, dtype=np.float64, order="C")
    outcomes, reward = np.asarray(model.outcomes, dtype=np.int64, order="C"), np.asarray(reward, dtype=np.float64, order="C")
    if not 0.0 <= discount < 1.0:
        raise InvalidValue(f"discount={discount!r}: valid is 0 <= discount < 1.")
    if outcomes.ndim != 3 or probabilities.shape != outcomes.shape:
        raise InvalidValue(f"outcomes of shape {outcomes.shape}, probabilities of {probabilities.shape}: valid is (S, A, B) for both.")
    if reward.shape != outcomes.shape[:2]:
        raise InvalidValue(f"reward has shape {reward.shape}: give one value for each state and action, shape {outcomes.shape[:2]}.")
    return probabilities, outcomes, reward


@cache
def load_planning() -> ModuleType:
    """The compiled sweeps, imported when they are first needed."""
    from mobee.engine.load import load_only

    return load_only("mobee.learning.sweeps")
