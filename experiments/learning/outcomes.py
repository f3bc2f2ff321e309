"""What is counted in the transitions of a run: (T, 3) integers, rows of state, action, state reached."""

from __future__ import annotations

import numpy as np

from mobee import Lattice
from mobee.robot.robot import Array, Ints


def goals_of(space: Lattice, seen: Ints) -> Ints:
    """At which state each transition aimed, (T,)."""
    found: Ints = space.goals[seen[:, 0], seen[:, 1]]
    return found


def tries_of(space: Lattice, seen: Ints) -> Ints:
    """How often each action was tried, (S, A)."""
    tries = np.zeros(space.goals.shape, dtype=np.intp)
    np.add.at(tries, (seen[:, 0], seen[:, 1]), 1)
    return tries


def failures_of(space: Lattice, seen: Ints) -> Ints:
    """How often each action did not end in its goal, (S, A)."""
    return tries_of(space, seen[seen[:, 2] != goals_of(space, seen)])


def failure_shares(space: Lattice, seen: Ints) -> Array:
    """Which share of an action's tries ended elsewhere than in its goal, (S, A); nan where there was none."""
    with np.errstate(invalid="ignore"):
        shares: Array = failures_of(space, seen) / tries_of(space, seen)
    return shares


def visits_of(space: Lattice, seen: Ints) -> Ints:
    """How often each state was reached, (S,)."""
    return np.bincount(seen[:, 2], minlength=len(space))


def ends_of(space: Lattice, seen: Ints, source: int, goal: int) -> dict[int, int]:
    """Where the action from a state towards a goal ended, and how often, the most frequent end first."""
    tried = (seen[:, 0] == source) & (goals_of(space, seen) == goal)
    states, counts = np.unique(seen[tried, 2], return_counts=True)
    return {int(states[i]): int(counts[i]) for i in np.argsort(-counts, kind="stable")}


def outcome_counts(space: Lattice, seen: Ints) -> Ints:
    """In how many different states each action was seen to end, (S, A)."""
    return tries_of(space, np.unique(seen, axis=0))


def exists_in(space: Lattice) -> Array:
    """Which entries of (S, A) are actions."""
    return np.asarray(space.goals >= 0)
