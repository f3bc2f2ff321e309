# SPDX-License-Identifier: Apache-2.0
"""Neighbour graphs of samples: for each state, the goal states of its actions, as a table (S, A) or as a list of edges (state, goal)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints

NO_ACTION = -1
DISTANCE_DECIMALS = 9  # squared distances that agree to here are a tie, whatever the rounding of the fractions
CHUNK = 1000  # states whose candidates are in memory at a time
MAX_COMPARED = 2000  # points up to which comparing all pairs is cheaper than importing SciPy's k-d tree (22 MB)


def lattice_strides(sizes: Sequence[int]) -> Ints:
    """Return by how much the number of a lattice state changes for one level of each joint, shape (joints,).

    `sizes`: number of levels of each joint. The first joint changes fastest: [1, L0, L0 L1, ...] for the sizes [L0, L1, ...].
    """
    return np.cumprod([1, *sizes[:-1]]).astype(np.intp)


def lattice_digits(sizes: Sequence[int]) -> Ints:
    """Return the index of each joint's level in each lattice state, shape (S, joints). `sizes`: number of levels of each joint."""
    digits: Ints = np.arange(np.prod(sizes))[:, None] // lattice_strides(sizes) % np.array(sizes)
    return digits


def equidistant_goals(digits: Ints, sizes: Sequence[int]) -> Ints:
    """Return for each lattice state the states one level away along one joint, ascending, shape (S, A) (thesis 7.2).

    Rows of states with fewer than A such neighbours end in NO_ACTION (-1). `digits`: (S, joints), from `lattice_digits`. `sizes`: number of
    levels of each joint.
    """
    states = np.arange(len(digits))
    strides = lattice_strides(sizes)
    down = np.where(digits > 0, states[:, None] - strides, NO_ACTION)[:, ::-1]
    up = np.where(digits < np.array(sizes) - 1, states[:, None] + strides, NO_ACTION)
    goals = np.concatenate([down, up], axis=1)
    absent = goals == NO_ACTION
    present_first = np.argsort(absent, axis=1, kind="stable")
    return np.take_along_axis(goals, present_first, axis=1)[:, : (~absent).sum(axis=1).max()]


def nearest_goals(points: Array, count: int, tie_seed: int) -> Ints:
    """Return for each of `points` (S, d) its `count` nearest other points, as indices in ascending order, shape (S, count).

    If several points are equally far, but not all of them are among the `count` nearest, a random choice with `tie_seed` decides. Memory
    grows with S times count, and so does time unless many points are equally far.
    """
    rng = np.random.default_rng(tie_seed)
    goals = np.empty((len(points), count), dtype=np.intp)
    for state, candidates in enumerate(_candidates(points, count)):
        goals[state] = _drawn(state, candidates, points, count, rng)
    return goals


def _candidates(points: Array, count: int) -> Iterator[Ints]:
    """Yield candidates for each point, ascending: all points that are as near as its `count` nearest others, and perhaps more."""
    if len(points) <= MAX_COMPARED:
        for _ in points:
            yield np.arange(len(points))
        return
    search = _tree(points)
    for first in range(0, len(points), CHUNK):
        some = points[first : first + CHUNK]
        reach = np.sqrt(search.query(some, count + 1)[0][:, -1] ** 2 + 10.0 ** (1 - DISTANCE_DECIMALS))
        for candidates in search.query_ball_point(some, reach, return_sorted=True):
            yield np.array(candidates)


def _drawn(state: int, candidates: Ints, points: Array, count: int, rng: np.random.Generator) -> Ints:
    """Return the indices of the `count` candidates that are nearest to the point of a state, ascending; the state itself is left out.

    If several candidates are equally far and not all of them are needed, `rng` chooses among them.
    """
    others = candidates[candidates != state]
    distance = np.round(((points[others] - points[state]) ** 2).sum(axis=1), DISTANCE_DECIMALS)
    last = np.partition(distance, count - 1)[count - 1]
    certain = others[distance < last]
    drawn = rng.choice(others[distance == last], size=count - len(certain), replace=False)
    return np.sort(np.concatenate([certain, drawn]))


def nearest_finder(points: Array) -> Callable[[Array], int]:
    """Return a function that takes a point, shape (d,), and returns the index of the nearest of `points`, shape (S, d)."""
    return partial(_nearest_of_few, points) if len(points) <= MAX_COMPARED else partial(_nearest_in_tree, _tree(points))


def _nearest_of_few(points: Array, point: Array) -> int:
    off = points - point
    return int(np.einsum("ij,ij->i", off, off).argmin())


def _nearest_in_tree(search: Any, point: Array) -> int:
    return int(search.query(point)[1])


def _tree(points: Array) -> Any:
    from scipy.spatial import KDTree

    return KDTree(points)


Edges = list[tuple[int, int]]  # state, goal


def edges_of(goals: Ints) -> Edges:
    """Return a list of all edges of a table of goals (S, A), state by state: a pair (state, goal) for each action that exists."""
    states, actions = np.nonzero(goals != NO_ACTION)
    return list(zip(states.tolist(), goals[states, actions].tolist(), strict=True))


def joined(edges: Edges) -> Edges:
    """Return the edges, a list of pairs (state, goal), without repetitions and in ascending order."""
    return sorted(set(edges))


def table_of(edges: Edges, states: int) -> Ints:
    """Return the goals of each state as a table (S, A): the inverse of `edges_of`.

    `edges`: pairs (state, goal) in ascending order. `states`: number of states S. Rows of states with fewer than A actions end in NO_ACTION
    (-1).
    """
    counts = np.bincount([state for state, _ in edges], minlength=states)
    goals: Ints = np.full((states, max(1, int(counts.max(initial=0)))), NO_ACTION, dtype=np.intp)
    for (state, goal), action in zip(edges, _ranks(counts), strict=True):
        goals[state, action] = goal
    return goals


def _ranks(counts: Ints) -> list[int]:
    """Return the number of each edge among the edges of its state: 0, 1, ... `counts`: (S,) number of edges from each state."""
    return [rank for count in counts.tolist() for rank in range(count)]
