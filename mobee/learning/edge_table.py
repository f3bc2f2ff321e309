"""Edges of a map as pairs, and as the table of goals of a Space."""

from __future__ import annotations

import numpy as np

from mobee.learning.neighbours import NO_ACTION
from mobee.robot.robot import Ints

Edges = list[tuple[int, int]]  # state, goal


def edges_of(goals: Ints) -> Edges:
    """All edges of a table of goals (S, A), state by state."""
    states, actions = np.nonzero(goals != NO_ACTION)
    return list(zip(states.tolist(), goals[states, actions].tolist(), strict=True))


def joined(edges: Edges) -> Edges:
    """Each edge once, ascending by state and goal."""
    return sorted(set(edges))


def table_of(edges: Edges, states: int) -> Ints:
    """The table of goals (S, A) of ascending edges, padded with NO_ACTION."""
    counts = np.bincount([state for state, _ in edges], minlength=states)
    goals: Ints = np.full((states, max(1, int(counts.max(initial=0)))), NO_ACTION, dtype=np.intp)
    for (state, goal), action in zip(edges, _ranks(counts), strict=True):
        goals[state, action] = goal
    return goals


def _ranks(counts: Ints) -> list[int]:
    """The number of each edge among those of its state."""
    return [rank for count in counts.tolist() for rank in range(count)]
