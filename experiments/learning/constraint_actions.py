"""The actions that meet constraints: those that fail in more than half of all tries."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from mobee.robot.robot import Array, Ints


class Tried(Protocol):
    """A run: tries and failures (E,) of the E state-actions."""

    @property
    def tries(self) -> Ints:
        """How often each was tried."""

    @property
    def failures(self) -> Ints:
        """How often each did not end in its goal."""


def constraint_actions(runs: Sequence[Tried]) -> Array:
    """Which state-actions (E,) failed in more than half of the tries of all runs, at least one, together."""
    return np.asarray(2 * sum(run.failures for run in runs) > sum(run.tries for run in runs))


def relative_tries(tries: Ints, chosen: Array) -> float:
    """Mean tries of the chosen state-actions over those of the others; 1 if there are none to compare."""
    if not chosen.any() or not tries[~chosen].any():
        return 1.0
    return float(tries[chosen].mean() / tries[~chosen].mean())
