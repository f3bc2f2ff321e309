# SPDX-License-Identifier: Apache-2.0
"""The transition model and planning of a curious agent: Algorithms 6 and 7 and the start of Algorithm 8 (thesis 6.4, 6.5).

T(s, a) (thesis eq. 6.1) is the distribution of the states in which action a of state s ends. It is stored as counts of observed
outcomes. Only states that have been an outcome have a count; eqs. 6.2 to 6.4 define which states can be outcomes.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.transitions import kl_divergence

Bins = dict[int, float]  # the counts behind T(s, a): how often each state was the outcome, in order of first observation

IMAGINED = {"50-50": ("stay", "goal"), "60-40": ("stay", "goal", "goal")}  # outcomes counted before an action is tried


def observe(bins: Bins, outcome: int) -> tuple[Bins, float]:
    """Count an outcome (state) of a state-action (Algorithm 6); return the new counts and the reward R = KL(P || T) in nats (eq. 6.5).

    `bins`: dict from each state that was an outcome to its count; an outcome that it does not contain is first added with the count 1.
    Then the count of the outcome increases by 1. T is the distribution before this increase, P that after it: R is the sum over the bins j
    of ln(P_j / T_j) P_j. Examples: eqs. 6.6 to 6.9.
    """
    before = bins if outcome in bins else bins | {outcome: 1.0}  # a new bin starts at 1
    after = before | {outcome: before[outcome] + 1.0}
    return after, kl_divergence(list(after.values()), list(before.values()))


def imagined(state: int, goal: int, initial: str = "50-50") -> tuple[Bins, float]:
    """Return the counts of an action before it is tried, a dict from state to count, and its first reward in nats (Algorithm 8, table 6.1).

    The counts are those of imagined outcomes, observed as if they were real. `state`, `goal`: the state in which the action begins, and its
    goal state. `initial`: "50-50" (one failure, which stays in the state, and one success) or "60-40" (one failure and two successes).
    """
    bins, reward = Bins(), 0.0
    for end in IMAGINED[initial]:
        bins, reward = observe(bins, state if end == "stay" else goal)
    return bins, reward


def forget(bins: Bins, floor: Bins, factor: float) -> Bins:
    """Multiply the counts of real observations by `factor` and return all counts; an agent that forgets does this before each observation.

    `bins`: dict from state to count. Each count is the sum of an imagined count, given before the action was first tried (`imagined`), and
    of a count of real observations. The imagined count is not changed. `floor`: dict from state to imagined count; the imagined count of a
    state that it does not contain is 1.
    """
    return {end: floor.get(end, 1.0) + factor * (count - floor.get(end, 1.0)) for end, count in bins.items()}


def observe_among_all(counts: Array, outcome: int) -> tuple[Array, float]:
    """Count an outcome in a model with a count for each state (thesis 6.4.2); return the new counts (S,) and the reward.

    The reward is the Kullback-Leibler divergence of the new distribution from the old one, in nats (eq. 6.5). `counts`: (S,), 1 for each
    state before the first observation. `outcome`: index of a state.
    """
    after = counts.copy()
    after[outcome] += 1.0
    return after, kl_divergence(after, counts)


def probabilities(bins: Bins) -> Bins:
    """Return T(s, a) as a dict from state to probability: each count in `bins` divided by the sum of all counts (thesis eq. 6.1)."""
    total = sum(bins.values())
    return {end: count / total for end, count in bins.items()}


def action_values(outcomes: Ints, chances: Array, reward: Array, discount: float, values: Array) -> Array:
    """Return Q(s, a) = R(s, a) + discount * sum over s' of T(s, a, s') V(s'), (S, A).

    `outcomes` (S, A, B): the states s' of the B bins of each state-action; `chances` (S, A, B): their probabilities T. `reward` (S, A): R.
    `values` (S,): V. A state-action does not exist if its reward is -inf or all its probabilities are 0; its Q is -inf.
    """
    exists = chances.any(axis=-1) & (reward != -np.inf)
    return np.where(exists, reward + discount * (chances * values[outcomes]).sum(axis=-1), -np.inf)


def value_iteration(
    outcomes: Ints, chances: Array, reward: Array, discount: float = 0.9, tolerance: float = 1e-3, start: Array | None = None
) -> tuple[Array, Array]:
    """Return V (S,) and Q (S, A), computed by sweeps until no Q changes by `tolerance` or more (thesis Algorithm 7).

    `outcomes` (S, A, B): the states in the B bins of each state-action; `chances` (S, A, B): their probabilities. `reward` (S, A); -inf: no
    such action. `discount`: factor of future rewards, 0 to 1. `start` (S,): first values, None: 0; a state without actions keeps its value.
    The thesis' algorithm compares the change with the tolerance without taking its absolute value. Then the sweeps would end too early
    when values have to decrease.
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
