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
    """`TransitionTable` of core/transitions.hpp; the caller keeps the arrays alive."""

    _fields_ = (
        *((name, ADDRESS) for name in ("probability", "outcome", "used")),
        *((name, INTEGER) for name in ("states", "actions", "bins")),
    )


class TransitionTable:
    """A `Table` that keeps its arrays alive: probabilities and outcomes (S, A, B), C-contiguous.

    `used` (S, A): number of bins in use of each state-action; the bins after them have probability 0. None: all are in use.
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
"""Sweep until no value changes by the tolerance; returns the number of sweeps over all actions, or one of the error codes above.

Arguments: the addresses of a `Table`, of the rewards (S, A), of the values (S,), which change in place, and of the action values (S, A),
which are filled; the discount; the tolerance; whether the tolerance is in units of the largest reward; whether to run modified policy
iteration.
"""


class DebiasedCounts(ctypes.Structure):
    """`DebiasedCounts` of core/observations.cpp; it keeps the arrays to which it points alive."""

    _fields_ = (("probability", ADDRESS), ("prior", ADDRESS), ("sum", REAL))

    def __init__(self, probabilities: Array, prior: Array, total: float) -> None:
        super().__init__(address(probabilities), address(prior), total)
        self.at = ctypes.addressof(self)
        self._kept: Any = probabilities, prior


class OutcomeCounts(ctypes.Structure):
    """`OutcomeCounts` of core/observations.cpp; it keeps the arrays to which it points alive. Observations write into these arrays.

    States, actions and outcomes are not checked here.
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
"""Return the reward [nats] of observing an outcome, without counting it; arguments: address of the counts, state, action, outcome."""
observe: Observation = function("observe", ADDRESS, INTEGER, INTEGER, INTEGER, result=REAL)
"""Observe an outcome and return its reward; below 0 if it was not counted because the table needs one more bin."""
believe: Callable[[int, int, int, int], None] = function("believe", ADDRESS, ADDRESS, INTEGER, INTEGER)
"""Compute debiased probabilities anew from counts; arguments: addresses of `OutcomeCounts` and `DebiasedCounts`, state, action."""
_expected_gains = function("expected_gains", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_deplete = function("deplete", ADDRESS, ADDRESS, ADDRESS, INTEGER, INTEGER, ADDRESS)


def expected_gains(table: TransitionTable, counts: Array, totals: Array, tries: Ints, gains: Array) -> None:
    """Replace the `gains` (S, A) of all tried state-actions by the expected information gain of their next try, in nats.

    `counts` (S, A, B): above 0 where the probability is above 0. `totals` (S, A): sums of `counts` over the bins. `tries` (S, A).
    """
    following = _NextCounts(address(counts), address(totals))
    _expected_gains(table.at, ctypes.addressof(following), address(tries), address(gains))


def deplete(table: TransitionTable, counts: Array, totals: Array, action_values: Array, state: int, steps: int, gains: Array) -> None:
    """Simulate `steps` best actions from a state, each with its most likely outcome, and reduce the `gains` (S, A) of these actions.

    Each gain is reduced as an observation of that outcome would reduce it. `action_values` (S, A): -inf where there is no action. For
    the other arguments see `expected_gains`.
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
    """Add to `out` (2, actions) the weighted sum of each action's values on targets near `target` (3,) m, and the sum of the weights.

    `targets` (..., 3) m; `keys` (..., 2): action and index of the target of each entry; `sums` (..., 2): sum and number of its values;
    `sizes`: number of targets and of entries.  `weighing`: a scale and a largest distance [m]: the weight of a target at a distance d is
    1 / (1 + d / scale), and 0 beyond the largest distance.
    """
    history = _History(address(targets), address(keys), address(sums), *sizes, *weighing)
    totals = address(out)
    _weighted_sums(ctypes.addressof(history), address(target), totals, totals + out[0].nbytes)


def gaussian_sums(asked: Array, events: Array, sums: Array) -> None:
    """Add to `sums` (2, n), for each of the points `asked` (n, d), the weighted sum of the events' values, and the sum of the weights.

    `events` (..., d + 1): rows of a point and a value.  The weight of an event at a distance r is exp(-r^2 / 2).
    """
    _gaussian_sums(address(asked), *asked.shape, address(events), len(events), address(sums))
