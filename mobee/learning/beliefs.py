"""Where actions lead as far as real observations tell: what to plan with."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from mobee.learning.bins import read_only, widened
from mobee.learning.value_iteration import OutcomeModel, Tabled
from mobee.robot.robot import Array, Ints

if TYPE_CHECKING:
    from mobee._core import observations
    from mobee._core.value_iteration import TransitionTable


class DebiasedCounts(Tabled):
    """Probabilities from real counts over a weak prior: an OutcomeModel that its transition model keeps up to date.

    The counts that Algorithm 6 and 8 imagine keep the reward finite, but they make an action that never failed
    look as if it failed 2 times in 4 + n.

    Args:
        model: whose bins they are.
        real: how often each outcome was really observed, shape (S, A, B).
        weight: their sums, shape (S, A).
        goal, stay: counts imagined for the first two bins; none for the others.
    """

    def __init__(self, model: OutcomeModel, real: Array, weight: Array, goal: float, stay: float) -> None:
        self._model = model
        self._prior: Array = np.zeros(real.shape[-1])
        self._prior[:2] = stay, goal
        self._sum = stay + goal
        probabilities = (real + self._prior) / (weight[:, :, None] + self._sum)
        self._probabilities: Array = np.where(model.probabilities.any(axis=-1, keepdims=True), probabilities, 0.0)
        self._believed: observations.DebiasedCounts | None = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_believed": None, "_table": None}  # a copy has arrays of its own

    @property
    def outcomes(self) -> Ints:
        """The state of each bin, shape (S, A, B); meaningless where the probability is 0."""
        return self._model.outcomes

    @property
    def probabilities(self) -> Array:
        """The probability of each bin, shape (S, A, B): sums to 1 over B, or 0 where there is no action (read only)."""
        return read_only(self._probabilities)

    def update(self, counts: observations.OutcomeCounts, state: int, action: int) -> None:
        """Follow the real counts of a state-action."""
        believed = self._believed or self._believe()
        _core().believe(counts.at, believed.at, state, action)

    def widen(self) -> None:
        """Make room for one more bin."""
        self._prior, self._probabilities = np.append(self._prior, 0.0), widened(self._probabilities)
        self._believed = self._table = None

    def _believe(self) -> observations.DebiasedCounts:
        """The probabilities where the core finds them."""
        self._believed = _core().DebiasedCounts(self._probabilities, self._prior, self._sum)
        return self._believed

    def _tabled(self) -> TransitionTable:
        from mobee._core.value_iteration import TransitionTable

        return TransitionTable(self._probabilities, self._model.outcomes)


@cache
def _core() -> Any:
    """Loaded when it is first needed."""
    from mobee._core import observations

    return observations
