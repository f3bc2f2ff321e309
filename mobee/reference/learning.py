"""The transition model and planning: Algorithms 6 and 7 and the start of Algorithm 8 (thesis 6.4, 6.5)."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.transitions import kl_divergence

Bins = dict[int, float]  # T(s, a): how often each state was the outcome, in order of first observation

IMAGINED = {"50-50": ("stay", "goal"), "60-40": ("stay", "goal", "goal")}


def observe(bins: Bins, outcome: int) -> tuple[Bins, float]:
    """Algorithm 6: count an outcome of a state-action; the new T(s, a), and the reward R = KL(P || T) in nats (eq. 6.5)."""
    before = bins if outcome in bins else bins | {outcome: 1.0}  # a new bin starts at 1
    after = before | {outcome: before[outcome] + 1.0}
    return after, kl_divergence(list(after.values()), list(before.values()))


def imagined(state: int, goal: int, initial: str = "50-50") -> tuple[Bins, float]:
    """The start of Algorithm 8: what an action is imagined to have done before it was tried, and its first reward (table 6.1)."""
    bins, reward = Bins(), 0.0
    for end in IMAGINED[initial]:
        bins, reward = observe(bins, state if end == "stay" else goal)
    return bins, reward


def forget(bins: Bins, floor: Bins, factor: float) -> Bins:
    """Before each observation of an agent that forgets: real counts times `factor`; those imagined, `floor` and 1 elsewhere, stay."""
    return {end: floor.get(end, 1.0) + factor * (count - floor.get(end, 1.0)) for end, count in bins.items()}


def observe_among_all(counts: Array, outcome: int) -> tuple[Array, float]:
    """Plain KL over all states, each imagined once (thesis 6.4.2): the new counts (S,) of a state-action, and the reward in nats."""
    after = counts.copy()
    after[outcome] += 1.0
    return after, kl_divergence(after, counts)


def probabilities(bins: Bins) -> Bins:
    """What the counts say: T(s, a) as a distribution."""
    total = sum(bins.values())
    return {end: count / total for end, count in bins.items()}


def action_values(outcomes: Ints, chances: Array, reward: Array, discount: float, values: Array) -> Array:
    """V(s, a) = R(s, a) + discount * sum over s' of T(s, a, s') V(s'), (S, A), from `outcomes` and their `chances` (S, A, B).

    -inf where there is no action: a reward of -inf, or no outcome that has a chance.
    """
    exists = chances.any(axis=-1) & (reward != -np.inf)
    return np.where(exists, reward + discount * (chances * values[outcomes]).sum(axis=-1), -np.inf)


def value_iteration(
    outcomes: Ints, chances: Array, reward: Array, discount: float = 0.9, tolerance: float = 1e-3, start: Array | None = None
) -> tuple[Array, Array]:
    """Algorithm 7: V (S,) and V(s, a) (S, A), by sweeps until no action's value changes by the tolerance or more.

    The thesis prints the change without its absolute value, and then stops at once where values have to fall.  A state without
    actions keeps its value of the `start` (S,), 0 if None.
    """
    values = np.zeros(len(outcomes)) if start is None else start
    exists = chances.any(axis=-1) & (reward != -np.inf)
    acting = exists.any(axis=1)
    before = np.where(exists, values[:, None], -np.inf)
    while True:
        found = action_values(outcomes, chances, reward, discount, values)
        values = np.where(acting, found.max(axis=1), values)
        if np.abs(found[exists] - before[exists]).max(initial=0.0) < tolerance:
            return values, found
        before = found
