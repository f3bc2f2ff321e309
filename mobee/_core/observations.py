"""Outcome counts and information gains; declares core/observations.cpp."""

from __future__ import annotations

import ctypes
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function
from mobee._core.value_iteration import TransitionTable

Array = NDArray[np.float64]
Ints = NDArray[np.int64]


class DebiasedCounts(ctypes.Structure):
    """`DebiasedCounts` of core/observations.cpp; keeps the arrays alive that it points to."""

    _fields_ = (("probability", ADDRESS), ("prior", ADDRESS), ("sum", REAL))

    def __init__(self, probabilities: Array, prior: Array, total: float) -> None:
        super().__init__(address(probabilities), address(prior), total)
        self.at = ctypes.addressof(self)
        self._kept: Any = probabilities, prior


class OutcomeCounts(ctypes.Structure):
    """`OutcomeCounts` of core/observations.cpp; keeps the arrays alive that it points to, which observations write into.

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
"""Of counts, by their address, a state, an action and an outcome: what observing it would pay now, in nats."""
observe: Observation = function("observe", ADDRESS, INTEGER, INTEGER, INTEGER, result=REAL)
"""Likewise, and count it; below 0 if it was not counted: there has to be one more bin first."""
believe: Callable[[int, int, int, int], None] = function("believe", ADDRESS, ADDRESS, INTEGER, INTEGER)
"""Let beliefs follow counts, both by their addresses, of a state and an action."""
_expected_gains = function("expected_gains", ADDRESS, ADDRESS, ADDRESS, ADDRESS)
_deplete = function("deplete", ADDRESS, ADDRESS, ADDRESS, INTEGER, INTEGER, ADDRESS)


def expected_gains(table: TransitionTable, counts: Array, totals: Array, tries: Ints, gains: Array) -> None:
    """Replace the `gains` (S, A) of all that was tried by the information gain to expect next, in nats.

    `counts` (S, A, B), above 0 where the probability is, and their `totals` (S, A).
    """
    following = _NextCounts(address(counts), address(totals))
    _expected_gains(table.at, ctypes.addressof(following), address(tries), address(gains))


def deplete(table: TransitionTable, counts: Array, totals: Array, action_values: Array, state: int, steps: int, gains: Array) -> None:
    """Follow the best actions from a state through their most likely outcomes, and let the `gains` (S, A) met fall as they would.

    `action_values` (S, A), -inf where there is no action; the others as of `expected_gains`.
    """
    following = _NextCounts(address(counts), address(totals))
    _deplete(table.at, ctypes.addressof(following), address(action_values), state, steps, address(gains))
