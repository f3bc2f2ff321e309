"""Where actions lead as far as real observations tell: what to plan with."""

from __future__ import annotations

import numpy as np

from mobee.learning.bins import read_only, widened
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array, Ints


class DebiasedCounts:
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

    @property
    def outcomes(self) -> Ints:
        """The state of each bin, shape (S, A, B); meaningless where the probability is 0."""
        return self._model.outcomes

    @property
    def probabilities(self) -> Array:
        """The probability of each bin, shape (S, A, B): sums to 1 over B, or 0 where there is no action (read only)."""
        return read_only(self._probabilities)

    def update(self, state: int, action: int, real: Array, weight: float) -> None:
        """Take the new real counts of a state-action, shape (bins,), and their sum."""
        np.divide(real + self._prior[: len(real)], weight + self._sum, out=self._probabilities[state, action, : len(real)])

    def widen(self) -> None:
        """Make room for one more bin."""
        self._prior, self._probabilities = np.append(self._prior, 0.0), widened(self._probabilities)
