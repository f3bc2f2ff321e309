"""What is counted in the record of an exploration."""

from __future__ import annotations

import numpy as np

from mobee import Lattice
from mobee.robot.robot import Array, Ints


def tries_of(space: Lattice, seen: Ints) -> Ints:
    """How often each state-action was tried, (S, A), in a record (T, 3) of state, action, state reached."""
    return _sum(space, seen, np.ones(len(seen), dtype=np.intp))


def failures_of(space: Lattice, seen: Ints) -> Ints:
    """How often each state-action did not end in its goal state, (S, A)."""
    state, action, reached = seen.T.astype(np.intp)
    return _sum(space, seen, (reached != space.goals[state, action]).astype(np.intp))


def visits_of(space: Lattice, seen: Ints) -> Ints:
    """How often each state was reached, (S,)."""
    return np.bincount(seen[:, 2], minlength=len(space))


def exists_in(space: Lattice) -> Array:
    """Which entries of (S, A) are state-actions."""
    return np.asarray(space.goals >= 0)


def _sum(space: Lattice, seen: Ints, what: Ints) -> Ints:
    total = np.zeros(space.goals.shape, dtype=np.intp)
    np.add.at(total, tuple(seen[:, :2].T.astype(np.intp)), what)
    return total
