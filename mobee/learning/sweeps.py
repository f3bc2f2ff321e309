"""The sweeps of value iteration.  Compiled."""

from __future__ import annotations

import numpy as np

from mobee.engine.compiled import entry_exact
from mobee.robot.robot import Array, Ints

_ROUNDING = 4.0 * 2.0**-52  # of a value: changes as small as this may cycle for ever


@entry_exact("float64[:,::1](float64[:,:,::1], int64[:,:,::1], float64[:,::1], float64[::1], float64, float64)")
def sweep(probabilities: Array, outcomes: Ints, reward: Array, values: Array, discount: float, tolerance: float) -> Array:
    """Jacobi sweeps until no action value changes by `tolerance`: `values` (S,) change in place, action values (S, A) are returned.

    `probabilities` and `outcomes` (S, A, B), `reward` (S, A); what has no probability, or a reward of -inf, is no action: its value
    is -inf.  A state without actions keeps its value.
    """
    states, actions, bins = outcomes.shape
    weights, following = np.empty(states * actions * bins), np.empty(states * actions * bins, dtype=np.int64)
    most = states * actions
    state, action, ends = np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64), np.empty(most, dtype=np.int64)
    rewards, before = np.empty(most), np.empty(most)
    rows, used = 0, 0
    for s in range(states):
        for a in range(actions):
            first = used
            for b in range(bins if reward[s, a] != -np.inf else 0):
                if probabilities[s, a, b] > 0.0:
                    weights[used], following[used] = discount * probabilities[s, a, b], outcomes[s, a, b]
                    used += 1
            if used > first:
                state[rows], action[rows], rewards[rows], ends[rows], before[rows] = s, a, reward[s, a], used, values[s]
                rows += 1
    best, found = values.copy(), np.full((states, actions), -np.inf)
    while True:
        change, largest, first, last = 0.0, 0.0, 0, -1
        for row in range(rows):
            s, value = state[row], 0.0
            for k in range(first, ends[row]):
                value += weights[k] * values[following[k]]
            first = ends[row]
            value += rewards[row]
            change, largest = max(change, abs(value - before[row])), max(largest, abs(value))
            before[row] = value
            if s != last or value > best[s]:
                best[s] = value
            last = s
        for s in range(states):
            values[s] = best[s]
        if not change >= tolerance or change <= _ROUNDING * largest:
            break
    for row in range(rows):
        found[state[row], action[row]] = before[row]
    return found
