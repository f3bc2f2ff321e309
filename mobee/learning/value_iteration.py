# SPDX-License-Identifier: Apache-2.0
"""Models of the outcomes of actions, and values of actions by value iteration (thesis Algorithm 7) and by policy iteration.

An outcome model gives the outcomes of each action and their probabilities. A learner's outcome model is called its beliefs.
"""

from __future__ import annotations

import ctypes
import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, UnknownName

if TYPE_CHECKING:
    from mobee._core.learning import TransitionTable

METHODS = ("jacobi", "modified")
BAD_REWARD = "reward holds NaN or +inf: valid are finite values, and -inf to exclude an action."
LEAST_PROBABILITY = 1e-3  # surprise of an outcome that the agent held impossible: that of this probability
PREDICTABLE_TRIES = 2
PREDICTABLE_SHARE = 0.8
"""A state-action is predictable if it was tried at least PREDICTABLE_TRIES (2) times, and this share of the tries had the same outcome."""
_MARGIN = 1e-13  # of the largest value, by which a better action must be better


class OutcomeModel(Protocol):
    """The interface of a transition model for planning: the outcomes of actions and their probabilities.

    S: states, A: largest number of actions of a state, B: largest number of outcomes of an action.
    """

    @property
    def outcomes(self) -> Ints:
        """The states in which each action may end, shape (S states, A actions, B outcomes); meaningless where the probability is 0."""

    @property
    def probabilities(self) -> Array:
        """The probability of each outcome, shape (S states, A actions, B outcomes); all 0 for an action that a state does not have."""


def require_beliefs_of(goals: Ints, beliefs: OutcomeModel) -> None:
    """Raise InvalidValue unless an outcome model has as many states and actions as a space, of which `goals` (S, A) is the table."""
    if np.shape(beliefs.probabilities)[:2] != goals.shape:
        given = " states, ".join(map(str, np.shape(beliefs.probabilities)[:2]))
        raise InvalidValue(
            f"beliefs of {given} actions, for a space of {goals.shape[0]} states, {goals.shape[1]} actions: give those of this space."
        )


class Tabled(ABC):
    """Base of an `OutcomeModel` that caches a table of its outcomes and probabilities in the form that the compiled core reads.

    A subclass sets `_table` to None when it replaces its arrays, and in a copy of the object, because the table has the addresses of the
    arrays; the table is then built again at the next use.
    """

    _table: TransitionTable | None = None

    @property
    def table(self) -> TransitionTable:
        """Outcomes and probabilities in the form that the compiled core reads; it is built when it is read first."""
        if self._table is None:
            self._table = self._tabled()
        return self._table

    @abstractmethod
    def _tabled(self) -> TransitionTable:
        """Make the table; each subclass does so from its own arrays."""


def probability_of(beliefs: OutcomeModel, s: int, a: int, outcome: int) -> float:
    """Return the probability, in the model `beliefs`, that action `a` in state `s` ends in the state `outcome`.

    It is 0 for a state that the model does not list as an outcome of the action.
    """
    return float(beliefs.probabilities[s, a][beliefs.outcomes[s, a] == outcome].sum())


def surprise_of(probability: float) -> float:
    """Return the surprise -ln p of an outcome of probability p, in nats; a p below LEAST_PROBABILITY (0.001) counts as this value."""
    return -math.log(max(probability, LEAST_PROBABILITY))


def value_iteration(
    model: OutcomeModel,
    reward: Array,
    discount: float = 0.9,
    tolerance: float = 1e-3,
    start: Array | None = None,
    relative: bool = False,
    method: Literal["jacobi", "modified"] = "jacobi",
) -> tuple[Array, Array]:
    """Compute the values of states V (S,) and of actions Q (S, A) under the best policy, by value iteration (thesis Algorithm 7).

    The sweeps stop when the absolute change of every value is below the tolerance. Algorithm 7 compares the change without the absolute
    value; so its sweeps would stop at once when values must decrease (negative rewards, or a start from earlier values after a reward has
    decreased). S: states, A: largest number of actions of a state.

    Args:
        model: the outcomes of the actions; a state without actions keeps its starting value.
        reward: (S, A) reward of each action; -inf excludes an action; entries without an action are ignored.
        discount: factor of future rewards, in [0, 1).
        tolerance: above 0; the values are within tolerance * discount / (1 - discount) of the exact values.
        start: (S,) values with which the first sweep begins; None: 0.
        relative: True: the tolerance is in units of the largest |reward| of an action (of 1 if all are 0); False: in units of the reward.
        method: "jacobi": Algorithm 7: every sweep updates all actions; it stops when no action value changes by the tolerance or more.
            "modified": modified policy iteration, faster: after each such sweep, a few sweeps update only the best action of each state; it
            stops when a sweep over all actions changes no state value by the tolerance or more.

    Returns:
        V and Q, with Q = -inf where there is no action.

    Raises:
        InvalidValue: an argument is not valid; the message gives the valid values.
        UnknownName: there is no such method.
    """
    core, address = _core()
    if isinstance(model, Tabled):
        known = model._table or model.table
        reward, table = _checked_reward(reward, known.rows, discount), known.at
    else:
        probabilities, outcomes, reward = tables(model, reward, discount)
        given = core.Table(address(probabilities), address(outcomes), None, *outcomes.shape)
        table = ctypes.addressof(given)
    states = len(reward)
    if not tolerance > 0.0:
        raise InvalidValue(f"tolerance={tolerance!r}: valid is a number above 0.")
    values = np.zeros(states) if start is None else np.array(start, dtype=np.float64)
    if values.shape != (states,):
        raise InvalidValue(f"start has shape {values.shape}: give one value for each of the {states} states.")
    if method not in METHODS:
        raise UnknownName("method", method, METHODS)
    action_values, evaluate = np.empty(reward.shape), method == "modified"
    at = address(reward), address(values), address(action_values)
    done = core.solve(table, *at, discount, tolerance, bool(relative), evaluate)
    if done > 0:
        return values, action_values
    if done == core.BAD_REWARD:
        raise InvalidValue(BAD_REWARD)
    if done == core.BAD_START:
        raise InvalidValue("start holds NaN or an infinity: give finite values.")
    raise InvalidValue(f"the model leads to a state that it does not have: valid are 0 to {states - 1}.")


def tables(model: OutcomeModel, reward: Array, discount: float) -> tuple[Array, Ints, Array]:
    """Return a model's probabilities (S, A, B) and outcomes (S, A, B), and the reward (S, A), as contiguous arrays of float64 and int64.

    S: states, A: largest number of actions of a state, B: largest number of outcomes of an action. An array that is contiguous and has the
    type already is not copied.

    Raises InvalidValue if the shapes do not fit or the discount is not in [0, 1).
    """
    probabilities = np.asarray(model.probabilities, dtype=np.float64, order="C")
    outcomes = np.asarray(model.outcomes, dtype=np.int64, order="C")
    if outcomes.ndim != 3 or probabilities.shape != outcomes.shape:
        raise InvalidValue(f"outcomes of shape {outcomes.shape}, probabilities of {probabilities.shape}: valid is (S, A, B) for both.")
    return probabilities, outcomes, _checked_reward(reward, outcomes.shape[:2], discount)


def policy_iteration(model: OutcomeModel, reward: Array, discount: float = 0.9) -> tuple[Array, Array]:
    """Compute the values of states V (S,) and of actions Q (S, A) under the optimal policy, by policy iteration (Howard 1960).

    Each policy is evaluated by a sparse linear solve, so the result is exact except for rounding errors. `model`, `reward` (S, A) and
    `discount` are as in `value_iteration`. Q is -inf where there is no action; a state without actions has value 0.
    Raises InvalidValue if the shapes do not fit, the discount is not in [0, 1), or the reward of an action is NaN or +inf.
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
        margin = _MARGIN * np.abs(values).max(initial=0.0)
        best, current = action_values[acting].max(axis=1, initial=-np.inf), action_values[acting, policy[acting]]
        better = acting[best > current + margin]
        if not len(better):
            return values, action_values
        policy[better] = action_values[better].argmax(axis=1)


def _evaluate(probabilities: Array, outcomes: Ints, rewards: Array, discount: float, acting: Ints, policy: Ints) -> Array:
    """Compute the values of a policy: V = R + discount P V in the states with actions, 0 elsewhere."""
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


def _checked_reward(reward: Array, rows: tuple[int, ...], discount: float) -> Array:
    if not 0.0 <= discount < 1.0:
        raise InvalidValue(f"discount={discount!r}: valid is 0 <= discount < 1.")
    reward = np.asarray(reward, np.float64, "C")
    if reward.shape != rows:
        raise InvalidValue(f"reward has shape {reward.shape}: give one value for each state and action, shape {rows}.")
    return reward


@cache
def _core() -> tuple[ModuleType, Callable[[NDArray[Any]], int]]:
    """Import the native functions when they are first needed, with the function that returns the address of an array."""
    from mobee._core import address, learning

    return learning, address
