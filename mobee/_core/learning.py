# SPDX-License-Identifier: Apache-2.0
"""Learning and planning: declares core/value_iteration.cpp, core/observations.cpp and core/histories.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]
Ints = NDArray[np.int64]

BAD_REWARD, BAD_OUTCOME, BAD_START = -1, -2, -3  # instead of the number of sweeps


class Table(ctypes.Structure):
    """The addresses and sizes of the arrays of a transition model: `TransitionTable` of core/transitions.hpp.

    The caller keeps the arrays alive.
    """

    _fields_ = (
        *((name, ADDRESS) for name in ("probability", "outcome", "used")),
        *((name, INTEGER) for name in ("states", "actions", "bins")),
    )


class TransitionTable:
    """A transition model in the form that the compiled core reads: a `Table`, and the arrays to which it points, which are kept alive.

    `probabilities`, `outcomes`: (S, A, B), C-contiguous; for each state-action, B bins, each with an outcome (index of a state) and its
    probability. `used` (S, A): number of bins in use of each state-action; the other bins have probability 0. None: all bins are in use.
    `at`: address of the `Table`. `rows`: the shape (S, A).
    """

    def __init__(self, probabilities: Array, outcomes: Ints, used: Ints | None = None) -> None:
        self._arrays = probabilities, outcomes, used
        at = None if used is None else address(used)
        self._table = Table(address(probabilities), address(outcomes), at, *outcomes.shape)
        self.at = ctypes.addressof(self._table)
        self.rows = outcomes.shape[:2]


solve: Callable[[int, int, int, int, float, float, bool, bool], int] = function(
    "value_iteration", ADDRESS, ADDRESS, ADDRESS, ADDRESS, REAL, REAL, INTEGER, INTEGER, result=INTEGER
)
"""Compute values by sweeps until no value changes by the tolerance or more; return the number of sweeps over all actions, or an error.

Arguments: the addresses of a `Table`, of the rewards (S, A), of the values (S,), which change in place, and of the action values (S, A),
which are filled; the discount; the tolerance; whether the tolerance is in units of the largest reward; whether to run modified policy
iteration. Errors: BAD_REWARD (-1): a reward is not finite; BAD_OUTCOME (-2): an outcome is no state; BAD_START (-3): a start value is not
finite.
"""


class DebiasedCounts(ctypes.Structure):
    """The structure `DebiasedCounts` of core/observations.cpp: outcome probabilities from observed outcomes and a weak prior.

    The probability of an outcome is (observations of the outcome + its prior count) / (observations of all outcomes + sum of the prior
    counts), for one state-action. The counts of a transition model (`OutcomeCounts`) also contain imagined counts: counts of outcomes that
    were not observed, with which each state-action starts (thesis Algorithms 6 and 8). They do not enter these probabilities.

    `probabilities`: (S, A, B), for each state-action the probability of each of B bins (a bin holds one outcome); the function `believe` of
    this module updates them. `prior` (B,): the prior count of each bin. `total`: the sum of `prior`. `at`: memory address of the structure,
    an argument of `believe`. The structure contains only the addresses of the two arrays; therefore this Python object refers to the
    arrays, so that they are not freed while it exists.
    """

    _fields_ = (("probability", ADDRESS), ("prior", ADDRESS), ("sum", REAL))

    def __init__(self, probabilities: Array, prior: Array, total: float) -> None:
        super().__init__(address(probabilities), address(prior), total)
        self.at = ctypes.addressof(self)
        self._kept: Any = probabilities, prior


class OutcomeCounts(ctypes.Structure):
    """The counts of a transition model for the core, `OutcomeCounts` of core/observations.cpp; observations write into its arrays.

    `arrays`: the arrays by the name of the structure's field, such as "count" (S, A, B); they are kept alive. `forgetting`: factor by
    which the counts of earlier observations of a state-action are multiplied at each new one. `at`: address of the structure. Functions of
    the core do not check the indices of states, actions and outcomes.

    The reward of an observation is the Kullback-Leibler divergence between the distributions of the outcomes after and before it.
    `over_states` defines these distributions: 0: over the outcomes that the state-action has had, the new one included; above 0: over this
    number of states, each with a count of 1 before the first observation.
    """

    _fields_ = (
        *((name, ADDRESS) for name in ("count", "probability", "outcome", "used", "weight", "total", "reward", "tries", "imagined")),
        *((name, INTEGER) for name in ("actions", "bins", "over_states")),
        ("forgetting", REAL),
    )

    def __init__(self, arrays: Mapping[str, NDArray[Any]], over_states: int, forgetting: float) -> None:
        _, actions, bins = arrays["count"].shape
        where = {name: address(array) for name, array in arrays.items()}
        super().__init__(actions=actions, bins=bins, over_states=over_states, forgetting=forgetting, **where)
        self.at = ctypes.addressof(self)
        self._kept: Any = arrays


class _NextCounts(ctypes.Structure):
    """`NextCounts` of core/observations.cpp."""

    _fields_ = (("count", ADDRESS), ("total", ADDRESS))


Observation = Callable[[int, int, int, int], float]
gain: Observation = function("gain", ADDRESS, INTEGER, INTEGER, INTEGER, result=REAL)
"""Return the reward [nats] that the observation of an outcome would have, without counting it.

Arguments: the address of the `OutcomeCounts`, and the indices of state, action and outcome.
"""
observe: Observation = function("observe", ADDRESS, INTEGER, INTEGER, INTEGER, result=REAL)
"""Count an outcome and return its reward [nats]; a value below 0 means that it was not counted, because the arrays need one more bin.

Arguments: the address of the `OutcomeCounts`, and the indices of state, action and outcome.
"""
believe: Callable[[int, int, int, int], None] = function("believe", ADDRESS, ADDRESS, INTEGER, INTEGER)
"""Compute the debiased probabilities of a state-action from its counts.

Arguments: the addresses of the `OutcomeCounts` and of the `DebiasedCounts`, and the indices of state and action.
"""
_expected_gains = function("expected_gains", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_deplete = function("deplete", ADDRESS, ADDRESS, ADDRESS, INTEGER, INTEGER, ADDRESS)


def expected_gains(table: TransitionTable, counts: Array, totals: Array, tries: Ints, gains: Array) -> None:
    """Replace the `gains` (S, A) of all tried state-actions by the expected information gain of their next try [nats], in place.

    `counts` (S, A, B): the count of the outcome of each of the B bins of `table`, above 0 for all bins with a probability above 0. `totals`
    (S, A): sums of `counts` over the bins. `tries` (S, A): how often each state-action was tried; gains of untried ones are not changed.
    """
    following = _NextCounts(address(counts), address(totals))
    _expected_gains(table.at, ctypes.addressof(following), address(tries), address(gains))


def deplete(table: TransitionTable, counts: Array, totals: Array, action_values: Array, state: int, steps: int, gains: Array) -> None:
    """Simulate the next `steps` best actions from a state, each with its most likely outcome, and reduce the gains of these actions.

    `gains` (S, A): the expected information gains [nats] of the next tries. They change in place: each gain is reduced as an observation of
    that outcome would reduce it. `counts` (S, A, B), `totals` (S, A): the counts of the outcomes in the B bins of `table`, and their sums
    over the bins. `action_values` (S, A): the best action of a state has the largest value; -inf for an action that the state does not
    have.
    """
    following = _NextCounts(address(counts), address(totals))
    _deplete(table.at, ctypes.addressof(following), address(action_values), state, steps, address(gains))


class _History(ctypes.Structure):
    """`History` of core/histories.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("targets", "keys", "sums")),
        *((name, INTEGER) for name in ("known", "used")),
        *((name, REAL) for name in ("scale", "near")),
    )


_weighted_sums = function("weighted_sums", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_gaussian_sums = function("gaussian_sums", ADDRESS, INTEGER, INTEGER, ADDRESS, INTEGER, ADDRESS)


def weighted_sums(
    targets: Array, keys: Ints, sums: Array, sizes: tuple[int, int], weighing: tuple[float, float], target: Array, out: Array
) -> None:
    """Add up the recorded values of each action, weighted by the distances of the recorded targets from `target` (3,) m.

    An entry of the record has the values of one action on one target. `out` (2, actions), to which the results are added: the sum of the
    weighted values, and the sum of the weights. `targets` (..., 3) m: only the first `sizes[0]` rows are used. `keys` (..., 2): action and
    index of the target of each entry. `sums` (..., 2): sum and number of the values of each entry. Only the first `sizes[1]` entries are
    used. `weighing`: a scale and a largest distance [m]: the weight of a target at a distance d is 1 / (1 + d / scale), and 0 beyond the
    largest distance.
    """
    history = _History(address(targets), address(keys), address(sums), *sizes, *weighing)
    totals = address(out)
    _weighted_sums(ctypes.addressof(history), address(target), totals, totals + out[0].nbytes)


def gaussian_sums(asked: Array, events: Array, sums: Array) -> None:
    """Add up the values of all events for each of the n points `asked` (n, d), weighted by the distances of the events from the point.

    `events` (..., d + 1): each row is the point of an event (d numbers) and its value.  The weight at a distance r is exp(-r^2 / 2). `sums`
    (2, n), to which the results are added: the sum of the weighted values, and the sum of the weights, for each point.
    """
    _gaussian_sums(address(asked), *asked.shape, address(events), len(events), address(sums))
