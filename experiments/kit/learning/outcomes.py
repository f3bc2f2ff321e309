# SPDX-License-Identifier: Apache-2.0
"""Counts of the transitions of a run: tries, failures, visits and ends.

Transitions are (T, 3) integers, rows of state, action, state reached.  Counts of state-actions are (S, A), or (E,) for the E state-actions
that exist, in row-major order of (S, A).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from experiments.kit.cells import CellResult
from experiments.kit.plots import draw_heights
from experiments.kit.sweep import runs_by
from mobee import Lattice
from mobee.arrays import Array, Ints

UNCERTAIN = (0.1, 0.9)  # shares of failures between which the outcome of an action is uncertain


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
    """Return the mask (E,) of the state-actions at constraints: those that failed in more than half of the tries of all runs together."""
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
