"""What the next observation of each state-action may be worth, and how that falls along a plan.  Compiled."""

from __future__ import annotations

from math import log1p

import numpy as np

from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def _expected(probabilities: Array, counts: Array, total: float, likely: int, more: float) -> float:
    """The information gain to expect, in nats, after `more` observations of the bin `likely`; arrays (B,)."""
    gain = 0.0
    for b in range(len(probabilities)):
        if probabilities[b] > 0.0:
            count = counts[b] + more if b == likely else counts[b]
            gain += probabilities[b] * (count + 1.0) / (total + more + 1.0) * log1p(1.0 / count)
    return max(0.0, gain - log1p(1.0 / (total + more)))


@entry_exact(
    """void(Array(float64, 3, "C", readonly=True), float64[:,:,::1], float64[:,::1], Array(int64, 2, "C", readonly=True),
            float64[:,::1])"""
)
def expected_gains(probabilities: Array, counts: Array, totals: Array, tries: Ints, gains: Array) -> None:
    """Replace the `gains` (S, A) of all that was tried by the information gain to expect next, in nats.

    `probabilities` (S, A, B) of the outcomes; `counts` (S, A, B), above 0 where the probability is, and their `totals` (S, A).
    """
    for s in range(tries.shape[0]):
        for a in range(tries.shape[1]):
            if tries[s, a]:
                gains[s, a] = _expected(probabilities[s, a], counts[s, a], totals[s, a], 0, 0.0)


@entry_exact(
    """void(Array(float64, 3, "C", readonly=True), Array(int64, 3, "C", readonly=True), float64[:,:,::1], float64[:,::1],
            Array(float64, 2, "C", readonly=True), int64, int64, float64[:,::1])"""
)
def deplete(
    probabilities: Array, outcomes: Ints, counts: Array, totals: Array, action_values: Array, state: int, steps: int, gains: Array
) -> None:
    """Follow the best actions from a state through their most likely outcomes, and let the `gains` (S, A) met fall as they would.

    `action_values` (S, A), -inf where there is no action; the others as of `expected_gains`.
    """
    met = np.zeros(gains.shape)
    s = state
    for _ in range(steps):
        a = int(np.argmax(action_values[s]))
        if action_values[s, a] == -np.inf:
            return
        likely = int(np.argmax(probabilities[s, a]))
        met[s, a] += 1.0
        gains[s, a] = min(gains[s, a], _expected(probabilities[s, a], counts[s, a], totals[s, a], likely, met[s, a]))
        s = outcomes[s, a, likely]
