# SPDX-License-Identifier: Apache-2.0
"""Outcomes of actions: counts of a run's transitions, true outcomes on a plant, and errors of transition models.

Transitions are (T, 3) integers, rows of state, action, state reached.  Counts of state-actions are (S, A), or (E,) for the E state-actions
that exist, in row-major order of (S, A).

The outcome of an action depends on where in the cell of its first state the part is, and on the momentum that it still has.  Therefore true
outcomes are measured by many tries on a walk through the states, in which each action starts where the last one ended, as for an agent.
Half of the steps are to a random neighbour, half are planned towards actions that need more tries.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.kit.cells import CellResult
from experiments.kit.learning.exploration import begin_nearby
from experiments.kit.plots import draw_heights
from experiments.kit.sweep import runs_by
from mobee import Lattice, Plant, TransitionModel, value_iteration
from mobee.arrays import Array, Ints
from mobee.learning.explorers import choose
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel

UNCERTAIN = (0.1, 0.9)  # shares of failures between which the outcome of an action is uncertain
ANYWHERE = 0.5  # share of a walk's steps that go to a random neighbour
DISCOUNT, TOLERANCE = 0.9, 0.01
CERTAIN = 0.9  # probability of the most likely outcome, below which an action is stochastic


def in_order(seen: Ints) -> Ints:
    """Return the transitions `seen` (T, 3) sorted by state, action and outcome.

    Sorted transitions compress much better, but their order in time is lost.  Counts of outcomes can still be computed from them.
    """
    return seen[np.lexsort(seen.T[::-1])]


def goals_of(space: Lattice, seen: Ints) -> Ints:
    """Return for each transition the goal state of its action, (T,).

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    found: Ints = space.goals[seen[:, 0], seen[:, 1]]
    return found


def tries_of(space: Lattice, seen: Ints) -> Ints:
    """Return the number of tries of each state-action, (S, A).

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    tries = np.zeros(space.goals.shape, dtype=np.intp)
    np.add.at(tries, (seen[:, 0], seen[:, 1]), 1)
    return tries


def failures_of(space: Lattice, seen: Ints) -> Ints:
    """Return the number of tries of each state-action that did not end in the goal of the action, (S, A).

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    return tries_of(space, seen[seen[:, 2] != goals_of(space, seen)])


def failure_shares(space: Lattice, seen: Ints) -> Array:
    """Return the share of the tries of each state-action that did not end in its goal, (S, A); NaN without tries.

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    with np.errstate(invalid="ignore"):
        shares: Array = failures_of(space, seen) / tries_of(space, seen)
    return shares


def visits_of(space: Lattice, seen: Ints) -> Ints:
    """Return how often each state was reached, (S,); the state in which the first transition starts is not counted.

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    return np.bincount(seen[:, 2], minlength=len(space))


def ends_of(space: Lattice, seen: Ints, source: int, goal: int) -> dict[int, int]:
    """Return how often the action from the state `source` to the state `goal` ended in each state, the most frequent first.

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    tried = (seen[:, 0] == source) & (goals_of(space, seen) == goal)
    states, counts = np.unique(seen[tried, 2], return_counts=True)
    return {int(states[i]): int(counts[i]) for i in np.argsort(-counts, kind="stable")}


def outcome_counts(space: Lattice, seen: Ints) -> Ints:
    """Return the number of different states in which each state-action ended, (S, A).

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    number = np.ravel_multi_index(seen.T, (*space.goals.shape, len(space)))  # one number a transition: rows are compared much more slowly
    return tries_of(space, seen[np.unique(number, return_index=True)[1]])


def exists_in(space: Lattice) -> NDArray[np.bool_]:
    """Return the mask (S, A) of the entries that are actions, True where an action exists: a state may have fewer than A actions."""
    return np.asarray(space.goals >= 0)


def first_places(values: ArrayLike) -> Ints:
    """Return the indices at which a value occurs for the first time in `values` (n,), ascending."""
    return np.sort(np.unique(values, return_index=True)[1])


def first_tries(space: Lattice, seen: Ints) -> Ints:
    """Return the numbers of the transitions that tried a state-action for the first time, counted from 1, ascending.

    `seen`: transitions (T, 3), rows of state, action, state reached, in order of time.
    """
    return first_places(seen[:, 0] * space.goals.shape[1] + seen[:, 1]) + 1


def uncertain_in(space: Lattice, seen: Ints) -> int:
    """Return the number of state-actions that failed in 10 to 90 % of their tries.

    `seen`: transitions (T, 3), rows of state, action, state reached.
    """
    return uncertain_of(failures_of(space, seen), tries_of(space, seen))


def uncertain_of(failures: Ints, tries: Ints) -> int:
    """Return the number of state-actions that failed in 10 to 90 % of their tries; `failures`, `tries`: counts of equal shape."""
    shares = failures / np.maximum(tries, 1)
    return int(((shares > UNCERTAIN[0]) & (shares < UNCERTAIN[1])).sum())


@dataclass(frozen=True, eq=False)
class Explored:
    """Counts of the transitions of one run.

    `seed`: seed of the run.  `tries`, `failures`: (E,), how often each of the E existing state-actions was tried, and failed.  `visits`:
    (S,), how often each state was reached.  `values`: all values that the run returned, by name.
    """

    seed: int
    tries: Ints
    failures: Ints
    visits: Ints
    values: Mapping[str, Any]


Groups = dict[tuple[str, str], list[Explored]]  # values of two settings


def explored(found: Mapping[str, CellResult], space_of: Callable[[str], Lattice], where: str, how: str) -> Groups:
    """Count tries, failures and visits in the runs of a sweep, and return the counts in groups of runs with equal settings.

    The key of a group is a pair: the values of the settings `where` and `how`.  The group is a list of runs, sorted by seed.  `found`: the
    finished runs by name; each has its transitions as the value "seen".  `space_of`: function that returns the space for a value of the
    setting `where`.
    """

    def of(result: CellResult) -> Explored:
        seen, space = result.values["seen"], space_of(result.cell.settings[where])
        tries, failures = (counts(space, seen)[exists_in(space)] for counts in (tries_of, failures_of))
        return Explored(result.cell.seed, tries, failures, visits_of(space, seen), result.values)

    return runs_by(found, of, where, how)


def constraint_actions(runs: Sequence[Explored]) -> NDArray[np.bool_]:
    """Return which state-actions are at constraints, (E,): those that failed in more than half of the tries of all runs together.

    The E state-actions are in the order of `Explored.tries`.
    """
    return np.asarray(2 * sum(run.failures for run in runs) > sum(run.tries for run in runs))


def relative_tries(tries: Ints, chosen: NDArray[np.bool_]) -> float:
    """Return the mean tries of the chosen state-actions divided by the mean tries of the others.

    NaN if no state-action is chosen, or if the others have no tries.  `tries`: (E,).  `chosen`: mask (E,).
    """
    if not chosen.any() or not tries[~chosen].any():
        return float("nan")
    return float(tries[chosen].mean() / tries[~chosen].mean())


def relative_tries_of(judged: Sequence[Explored], runs: Sequence[Explored]) -> list[float]:
    """Return for each judged run the mean tries of state-actions at constraints, divided by the mean tries of the other state-actions.

    A state-action is at a constraint if it failed in more than half of its tries in all `runs` together, without the judged one.  So an
    action is not selected because it failed by chance in the judged run.  Runs whose ratio is NaN are left out.
    """
    ratios = [relative_tries(one.tries, constraint_actions([run for run in runs if run is not one])) for one in judged]
    return [ratio for ratio in ratios if np.isfinite(ratio)]


def draw_tries(axes: Any, tries: Ints, chosen: NDArray[np.bool_], width: float, label: str) -> None:
    """Draw the tries (E,) of every state-action as bars.

    `chosen`: mask (E,) of the state-actions whose bars are red, `width` wide and named `label` in the legend; the others are grey.  `axes`:
    of Matplotlib.
    """
    number = np.arange(len(tries))
    draw_heights(axes, np.where(chosen, 0, tries), color="0.6", label="others")
    axes.bar(number[chosen], tries[chosen], width=width, color="C3", label=label)


@dataclass(frozen=True, eq=False)
class Truth:
    """Measured frequencies of the outcomes of each state-action; a `mobee.learning.value_iteration.OutcomeModel`.

    `outcomes`: (S, A, B), the states reached, up to B for each state-action.  `probabilities`: (S, A, B), their frequencies; 0 in unused
    entries, and where there is no action or no try.  `tries`: (S, A), number of tries.
    """

    outcomes: Ints
    probabilities: Array
    tries: Ints


def truth_of(space: Space, seen: Ints) -> Truth:
    """Return the frequencies of the outcomes in transitions `seen` (T, 3), rows of state, action, state reached."""
    states, actions = space.goals.shape
    keys, counts = np.unique(np.ravel_multi_index(tuple(seen.T), (states, actions, states)), return_counts=True)
    pair, reached = np.divmod(keys, states)
    first = np.searchsorted(pair, pair)  # of the outcomes of the same state-action
    bin_ = np.arange(len(pair)) - first
    outcomes = np.zeros((states * actions, max(bin_, default=0) + 1), dtype=np.intp)
    counted = np.zeros(outcomes.shape)
    outcomes[pair, bin_], counted[pair, bin_] = reached, counts
    tries = counted.sum(axis=1, keepdims=True)
    shape = (states, actions, -1)
    probabilities = counted / np.maximum(tries, 1.0)
    return Truth(outcomes.reshape(shape), probabilities.reshape(shape), tries.reshape(states, actions).astype(np.intp))


def walk(space: Space, plant_of: Callable[[int], Plant], tries: int, most: int, seed: int) -> Ints:
    """Walk through the states until every action was tried `tries` times; returns the transitions (T, 3): state, action, state reached.

    `plant_of`: function that returns a new plant for a seed.  `most`: largest number of transitions, after which the walk ends in any case.
    `seed`: seed of the plant and of the random actions.
    """
    plant, rng = plant_of(seed), np.random.default_rng(seed)
    model, values = TransitionModel(space), np.zeros(len(space))
    state = begin_nearby(space, plant, seed)
    lacking = np.where(space.goals == NO_ACTION, 0.0, 1.0)
    seen: list[tuple[int, int, int]] = []
    while lacking.any() and len(seen) < most:
        if rng.random() < ANYWHERE:
            action = int(rng.integers(len(space.actions(state))))
        else:
            values, found = value_iteration(model.debiased(), lacking, DISCOUNT, TOLERANCE, values)
            action = choose(found[state], rng)
        outcome = plant.act(space.part, space.target(space.goal(state, action)))
        reached = space.state_of(outcome.q)
        model.observe(state, action, reached)
        lacking[state, action] = max(0.0, 1.0 - model.tries[state, action] / tries)
        seen.append((state, action, reached))
        state = reached
    return np.array(seen, dtype=np.intp).reshape(-1, 3)


def l1(beliefs: OutcomeModel, truth: OutcomeModel) -> Array:
    """Return the L1 error of a transition model, the sum of |p - q| over the outcomes of each state-action, (S, A), 0 to 2.

    `beliefs`: the model.  `truth`: the true outcomes.  The error is NaN for a state-action that does not exist or was never tried.  The
    outcomes of the two models may differ in order and number, and several outcomes of a model may stand for the same state: their
    probabilities are added.
    """
    states, actions = truth.outcomes.shape[:2]
    pair = np.arange(states * actions)[:, None]
    keys, signed = [], []
    for model, sign in ((beliefs, 1.0), (truth, -1.0)):
        probabilities = model.probabilities.reshape(states * actions, -1)
        keys.append((pair * states + model.outcomes.reshape(probabilities.shape))[probabilities > 0.0])
        signed.append(sign * probabilities[probabilities > 0.0])
    found, index = np.unique(np.concatenate(keys), return_inverse=True)
    difference = np.abs(np.bincount(index, weights=np.concatenate(signed)))
    error = np.bincount(found // states, weights=difference, minlength=states * actions).reshape(states, actions)
    return np.where(truth.probabilities.any(axis=-1), error, np.nan)


def most_likely(truth: OutcomeModel) -> Array:
    """Return the probability of the most likely outcome of each state-action, (S, A); NaN without an action or a try."""
    highest: Array = truth.probabilities.max(axis=-1)
    return np.where(highest > 0.0, highest, np.nan)


def model_error(beliefs: OutcomeModel, truth: OutcomeModel) -> tuple[float, float]:
    """Return the mean L1 error of a transition model over all state-actions, and over the stochastic ones only (NaN if there are none).

    `beliefs`: the model.  `truth`: the true outcomes.  A state-action is stochastic if its most likely outcome has a probability below 0.9.
    """
    error = l1(beliefs, truth)
    stochastic = most_likely(truth) < CERTAIN
    return float(np.nanmean(error)), float(error[stochastic].mean()) if stochastic.any() else float("nan")


def sampling_error(truth: Truth) -> Array:
    """Return the expected L1 distance between the measured frequencies and the true distribution, (S, A); NaN without tries.

    It is the sum of sqrt(2 p (1 - p) / (pi n)) over the outcomes: the mean absolute error of a frequency p that was measured in n tries.
    An error of a model that is smaller than this distance cannot be measured.
    """
    p = truth.probabilities
    with np.errstate(invalid="ignore", divide="ignore"):
        error: Array = np.sqrt(2.0 * p * (1.0 - p) / (np.pi * truth.tries[..., None])).sum(axis=-1)
    return error
