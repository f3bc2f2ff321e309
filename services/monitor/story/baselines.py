# SPDX-License-Identifier: Apache-2.0
"""Simulates two explorers (exploration strategies), random and least-tried, to compare their learning curves with that of an agent.

The simulations use the outcomes of actions that the agent has observed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bus_schema.messages import Learned
from mobee.arrays import Array, Ints
from mobee.learning.space import Space
from mobee.learning.value_iteration import PREDICTABLE_SHARE, PREDICTABLE_TRIES
from services.monitor.story.knowledge import Knowledge

BASELINES = ("least_tried", "random")
RUNS = 4  # of each; their mean is shown
POINTS = 60  # of a curve
LONGEST = 10_000  # transitions that are simulated: 0.4 s of a core
SEED = 0

Curve = list[tuple[int, float, float]]
"""A learning curve, as points (number of transitions, share of the state-actions that were tried, share that are predictable). A
state-action is predictable if it was tried at least twice, with the same outcome in at least 80 % of the tries."""


@dataclass(frozen=True, eq=False)
class Outcomes:
    """The possible outcomes of all state-actions: S states, A actions of each state, at most B outcomes of each state-action.

    `states`: next states of each state-action, (S, A, B); a state-action with fewer than B outcomes has further entries of probability 0.
    `cumulative`: their cumulative probabilities along the last axis, (S, A, B).
    """

    states: Ints
    cumulative: Array


def outcomes_of(learned: Learned, known: Knowledge, space: Space) -> Outcomes:
    """Return the outcomes that an agent has observed in each state-action, with their relative frequencies as probabilities.

    A state-action that was never tried gets two outcomes: its goal, and the state in which the action begins. The probability of the goal
    is the success rate of all the agent's tries.
    """
    found: dict[tuple[int, int], list[tuple[int, float]]] = {}
    (count, actions), missed = known.tries.shape, np.zeros(known.tries.shape)
    for one in learned.surprises:
        if one.s < count and one.a < actions and one.s_next < count:
            found.setdefault((one.s, one.a), []).append((one.s_next, one.share))
            missed[one.s, one.a] += one.share
    width = 1 + max((len(rows) for rows in found.values()), default=1)
    states = np.tile(np.arange(count)[:, None, None], (1, actions, width))
    shares = np.zeros((count, actions, width))
    states[:, :, 0], shares[:, :, 0] = np.where(known.exists, space.goals, 0), np.clip(1.0 - missed, 0.0, 1.0)
    for (s, a), rows in found.items():
        for place, (state, share) in enumerate(rows, start=1):
            states[s, a, place], shares[s, a, place] = state, share
    tries = known.tries.sum()
    untried = known.tries == 0
    shares[untried, 0] = (known.tries * shares[:, :, 0]).sum() / tries if tries else 1.0
    shares[untried, 1] = 1.0 - shares[untried, 0]
    return Outcomes(states, np.cumsum(shares, axis=2))


def baselines(outcomes: Outcomes, exists: NDArray[np.bool_], start: int, transitions: int) -> dict[str, Curve]:
    """Simulate two explorers, "least_tried" and "random", and return the learning curve of each, by name.

    A learning curve is the mean of 4 simulations. It is a list of points (number of transitions, share of the state-actions that were
    tried, share of the state-actions that are predictable), as defined at `Curve`. `outcomes`: the possible outcomes of all state-actions,
    with their probabilities. `exists`: (S, A), by state and action, True where the state has the action. `start`: state in which every
    simulation begins. `transitions`: length of each simulation; more than LONGEST (10 000) transitions are not simulated.
    """
    transitions = min(transitions, LONGEST)
    rng = np.random.default_rng(SEED)
    rows = np.arange(len(BASELINES) * RUNS)
    is_random = rows >= RUNS
    state = np.full(len(rows), start)
    counts = np.zeros((len(rows), *outcomes.states.shape), dtype=np.int32)
    tries = np.where(exists, 0, np.iinfo(np.int32).max // 2)[None].repeat(len(rows), axis=0)
    shown = set(np.unique(np.linspace(0, transitions, POINTS).astype(int)).tolist())
    curves: dict[str, Curve] = {name: [(0, 0.0, 0.0)] for name in BASELINES}
    weight = np.where(is_random, 0.0, 1.0)[:, None]
    absent = np.where(exists, 0.0, np.inf)
    for n in range(1, transitions + 1):
        drawn = rng.random((len(rows), exists.shape[1] + 1))
        action = (weight * tries[rows, state] + drawn[:, 1:] + absent[state]).argmin(axis=1)
        place = (drawn[:, :1] > outcomes.cumulative[state, action, :-1]).sum(axis=1)
        tries[rows, state, action] += 1
        counts[rows, state, action, place] += 1
        state = outcomes.states[state, action, place]
        if n in shown:
            for first, name in enumerate(BASELINES):
                tried, predictable = _shares(counts[first * RUNS : (first + 1) * RUNS], exists)
                curves[name].append((n, round(tried, 4), round(predictable, 4)))
    return curves


def _shares(counts: NDArray[np.int32], exists: NDArray[np.bool_]) -> tuple[float, float]:
    tries = counts.sum(axis=3)
    predictable = (tries >= PREDICTABLE_TRIES) & (counts.max(axis=3) >= PREDICTABLE_SHARE * tries)
    return float((tries > 0)[:, exists].mean()), float(predictable[:, exists].mean())
