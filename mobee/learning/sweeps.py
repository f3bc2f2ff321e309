"""The sweeps of value iteration.  Compiled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee.engine.compiled import entry_exact, inner_exact
from mobee.robot.robot import Array, Ints

UInts = NDArray[np.uint64]  # as an index it never counts from the end, which costs a look at its sign

BAD_REWARD, BAD_OUTCOME, BAD_START = -1, -2, -3  # instead of the number of sweeps
_ROUNDING = 4.0 * 2.0**-52  # of a value: changes as small as this may cycle for ever
_EVALUATED = 60  # improvements that are followed by an evaluation; those after them are plain sweeps, which converge from anywhere
_EVALUATIONS = 5  # sweeps of one evaluation at most
_ALIKE = 0.5  # changes whose spread is less than this share of the largest


@inner_exact
def _pack(
    probabilities: Array,
    outcomes: Ints,
    reward: Array,
    values: Array,
    discount: float,
    ends: Ints,
    weights: Array,
    following: UInts,
    found: Array,
) -> int:
    """The bins that are not empty, action by action, and the first sweep on the way.

    Row s A + a has the bins ends[row] .. ends[row + 1], none if there is no such action; `weights` are the discounted
    probabilities.  Returns 0, or what is wrong.
    """
    row, used, ends[0] = 0, 0, 0
    for s in range(outcomes.shape[0]):
        for a in range(outcomes.shape[1]):
            value = 0.0
            for b in range(outcomes.shape[2] if reward[s, a] != -np.inf else 0):
                if probabilities[s, a, b] != 0.0:
                    if not 0 <= outcomes[s, a, b] < outcomes.shape[0]:
                        return BAD_OUTCOME
                    weights[used], following[used] = discount * probabilities[s, a, b], outcomes[s, a, b]
                    value += weights[used] * values[following[used]]
                    used += 1
            if used == ends[row]:
                found[s, a] = -np.inf
            elif np.isfinite(reward[s, a]):
                found[s, a] = value + reward[s, a]
            else:
                return BAD_REWARD
            row += 1
            ends[row] = used
    return 0


@inner_exact
def _evaluate(
    chosen: Ints,
    ends: Ints,
    weights: Array,
    following: UInts,
    rewards: Array,
    values: Array,
    new: Array,
    discount: float,
    tolerance: float,
) -> None:
    """A few sweeps over one row a state, all from the old values, so that states that are alike stay so.

    Where all values change by much the same, they will go on to by discount / (1 - discount) times as much: that step is taken at once.
    """
    for _ in range(_EVALUATIONS):
        least, most = np.inf, -np.inf
        for s in range(len(values)):
            row = chosen[s]
            if row >= 0:
                value = 0.0
                for k in range(ends[row], ends[row + 1]):
                    value += weights[k] * values[following[k]]
                value += rewards[row]
                least, most = min(least, value - values[s]), max(most, value - values[s])
                new[s] = value
        change, ahead = max(abs(least), abs(most)), 0.0
        if most - least < _ALIKE * change:
            change, ahead = most - least, 0.5 * (least + most) * discount / (1.0 - discount)
        for s in range(len(values)):
            if chosen[s] >= 0:
                values[s] = new[s] + ahead
        if change < tolerance:
            return


@entry_exact(
    """int64(Array(float64, 3, "C", readonly=True), Array(int64, 3, "C", readonly=True), Array(float64, 2, "C", readonly=True),
             float64[::1], float64[:,::1], float64, float64, boolean, boolean)"""
)
def solve(
    probabilities: Array,
    outcomes: Ints,
    reward: Array,
    values: Array,
    found: Array,
    discount: float,
    tolerance: float,
    relative: bool,
    evaluate: bool,
) -> int:
    """Sweep over all actions until no value changes by `tolerance`; `values` (S,) change in place, `found` (S, A) is filled.

    Every sweep finds all action values from the old state values, then all state values (Algorithm 7, which looks at the
    changes of the action values).  With `evaluate` each is followed by sweeps over the best action of each state alone
    (modified policy iteration, which looks at the changes of the state values).

    `probabilities` and `outcomes` (S, A, B) are read where they are; what has no probability, or a `reward` (S, A) of -inf, is
    no action: its value is -inf.  A state without actions keeps its value.  Returns the number of sweeps over all actions, or
    what is wrong.
    """
    states, actions = reward.shape
    for s in range(states):
        if not np.isfinite(values[s]):
            return BAD_START
    ends, weights, following = np.empty(reward.size + 1, dtype=np.int64), np.empty(outcomes.size), np.empty(outcomes.size, dtype=np.uint64)
    wrong = _pack(probabilities, outcomes, reward, values, discount, ends, weights, following, found)
    if wrong:
        return wrong
    rewards, rows = reward.reshape(reward.size), found.reshape(reward.size)
    limit, largest = tolerance, 0.0
    for row in range(reward.size if relative else 0):
        if ends[row + 1] > ends[row]:
            largest = max(largest, abs(rewards[row]))
    if largest > 0.0:
        limit *= largest
    new, chosen, sweeps = values.copy(), np.empty(states, dtype=np.int64), 0
    while True:
        change, largest, k = 0.0, 0.0, 0
        for s in range(states):
            best, at = -np.inf, -1
            for row in range(s * actions, (s + 1) * actions):
                end = ends[row + 1]
                if end == ends[row]:
                    continue
                value = rows[row]
                if sweeps == 0:  # found while it was packed
                    before = values[s]
                else:
                    before, value = value, 0.0
                    while k < end:
                        value += weights[k] * values[following[k]]
                        k += 1
                    value += rewards[row]
                    rows[row] = value
                if not evaluate and abs(value - before) > change:
                    change = abs(value - before)
                if value > best:
                    best, at = value, row
            chosen[s] = at
            if at >= 0:
                new[s], largest = best, max(largest, abs(best))
                if evaluate and abs(best - values[s]) > change:
                    change = abs(best - values[s])
        values[:], sweeps = new, sweeps + 1
        if change < limit or change <= _ROUNDING * largest:
            return sweeps
        if evaluate and sweeps <= _EVALUATED:
            _evaluate(chosen, ends, weights, following, rewards, values, new, discount, 0.5 * (1.0 - discount) * limit)
