# SPDX-License-Identifier: Apache-2.0
"""Counts of the transitions of a run: tries, failures, visits and ends.

Transitions are (T, 3) integers, rows of state, action, state reached.  Counts of state-actions are (S, A), or (E,) of those that exist.
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
    """Return the transitions (T, 3) sorted by state, action and outcome; sorted records are much smaller, and suffice for counts."""
    return seen[np.lexsort(seen.T[::-1])]


def goals_of(space: Lattice, seen: Ints) -> Ints:
    """Return the goal state of each transition, (T,)."""
    found: Ints = space.goals[seen[:, 0], seen[:, 1]]
    return found


def tries_of(space: Lattice, seen: Ints) -> Ints:
    """Return the number of tries of each action, (S, A)."""
    tries = np.zeros(space.goals.shape, dtype=np.intp)
    np.add.at(tries, (seen[:, 0], seen[:, 1]), 1)
    return tries


def failures_of(space: Lattice, seen: Ints) -> Ints:
    """Return the number of tries of each action that did not end in its goal, (S, A)."""
    return tries_of(space, seen[seen[:, 2] != goals_of(space, seen)])


def failure_shares(space: Lattice, seen: Ints) -> Array:
    """Return the share of the tries of each action that did not end in its goal, (S, A); NaN without tries."""
    with np.errstate(invalid="ignore"):
        shares: Array = failures_of(space, seen) / tries_of(space, seen)
    return shares


def visits_of(space: Lattice, seen: Ints) -> Ints:
    """Return how often each state was reached, (S,)."""
    return np.bincount(seen[:, 2], minlength=len(space))


def ends_of(space: Lattice, seen: Ints, source: int, goal: int) -> dict[int, int]:
    """Return how often the action from `source` towards `goal` ended in each state, the most frequent first."""
    tried = (seen[:, 0] == source) & (goals_of(space, seen) == goal)
    states, counts = np.unique(seen[tried, 2], return_counts=True)
    return {int(states[i]): int(counts[i]) for i in np.argsort(-counts, kind="stable")}


def outcome_counts(space: Lattice, seen: Ints) -> Ints:
    """Return the number of different states in which each action ended, (S, A)."""
    number = np.ravel_multi_index(seen.T, (*space.goals.shape, len(space)))  # one number a transition: rows are compared much more slowly
    return tries_of(space, seen[np.unique(number, return_index=True)[1]])


def exists_in(space: Lattice) -> NDArray[np.bool_]:
    """Return which entries of (S, A) are actions."""
    return np.asarray(space.goals >= 0)


def first_places(values: ArrayLike) -> Ints:
    """Return the indices at which each value occurs for the first time, ascending."""
    return np.sort(np.unique(values, return_index=True)[1])


def first_tries(space: Lattice, seen: Ints) -> Ints:
    """Return the numbers, counted from 1, of the transitions that tried a state-action for the first time, ascending."""
    return first_places(seen[:, 0] * space.goals.shape[1] + seen[:, 1]) + 1


def uncertain_in(space: Lattice, seen: Ints) -> int:
    """Return the number of actions that failed in 10 to 90 % of their tries."""
    return uncertain_of(failures_of(space, seen), tries_of(space, seen))


def uncertain_of(failures: Ints, tries: Ints) -> int:
    """Return the number of actions that failed in 10 to 90 % of their tries, both (S, A)."""
    shares = failures / np.maximum(tries, 1)
    return int(((shares > UNCERTAIN[0]) & (shares < UNCERTAIN[1])).sum())


@dataclass(frozen=True, eq=False)
class Explored:
    """Counts of one run: tries and failures (E,) of the state-actions, visits (S,) of the states, and all `values` of its cell."""

    seed: int
    tries: Ints
    failures: Ints
    visits: Ints
    values: Mapping[str, Any]


Groups = dict[tuple[str, str], list[Explored]]  # values of two settings


def explored(found: Mapping[str, CellResult], space_of: Callable[[str], Lattice], where: str, how: str) -> Groups:
    """Group the runs that recorded transitions as "seen" by two settings, sorted by seed; the setting `where` decides the space."""

    def of(result: CellResult) -> Explored:
        seen, space = result.values["seen"], space_of(result.cell.settings[where])
        tries, failures = (counts(space, seen)[exists_in(space)] for counts in (tries_of, failures_of))
        return Explored(result.cell.seed, tries, failures, visits_of(space, seen), result.values)

    return runs_by(found, of, where, how)


def constraint_actions(runs: Sequence[Explored]) -> NDArray[np.bool_]:
    """Return which actions are at constraints, (E,): those that failed in more than half of the tries of all runs."""
    return np.asarray(2 * sum(run.failures for run in runs) > sum(run.tries for run in runs))


def relative_tries(tries: Ints, chosen: NDArray[np.bool_]) -> float:
    """Return the mean tries of the chosen state-actions over those of the others; NaN if one group is empty."""
    if not chosen.any() or not tries[~chosen].any():
        return float("nan")
    return float(tries[chosen].mean() / tries[~chosen].mean())


def relative_tries_of(judged: Sequence[Explored], runs: Sequence[Explored]) -> list[float]:
    """Return `relative_tries` of each judged run at the constraint actions of the other `runs`, without NaN.

    The judged run itself is left out, so that tries of an action that failed by chance do not count on both sides.
    """
    ratios = [relative_tries(one.tries, constraint_actions([run for run in runs if run is not one])) for one in judged]
    return [ratio for ratio in ratios if np.isfinite(ratio)]


def draw_tries(axes: Any, tries: Ints, chosen: NDArray[np.bool_], width: float, label: str) -> None:
    """Draw the tries (E,) of every state-action as bars, the chosen ones in red and as wide as `width`."""
    number = np.arange(len(tries))
    draw_heights(axes, np.where(chosen, 0, tries), color="0.6", label="others")
    axes.bar(number[chosen], tries[chosen], width=width, color="C3", label=label)
