"""Which vertices of a map are joined by an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Ints


def nearest(y: Array, spacing: ArrayLike, count: int) -> Ints:
    """Edges (E, 2) from each vertex to the `count` nearest of all others, by task coordinates y (V, m) in units of spacing.

    As of all edges the lower vertex comes first, each is there once, and they are sorted.
    """
    if count < 1:
        raise InvalidValue(f"{count} neighbours: each vertex needs at least 1.")
    most = min(count, len(y) - 1)
    if most < 1:
        return np.empty((0, 2), dtype=np.intp)
    from scipy.spatial import KDTree

    places = y / np.asarray(spacing)
    found = KDTree(places).query(places, most + 1)[1]
    own = np.arange(len(y))
    others = [row[row != vertex][:most] for vertex, row in enumerate(found)]  # of equal places the own need not be the first
    return sorted_edges(np.stack([np.repeat(own, most), np.concatenate(others)], axis=1))


def nearest_before(y: Array, spacing: ArrayLike, count: int) -> Ints:
    """Edges (E, 2) from each vertex to the `count` nearest of those found before it, as thesis Algorithm 4 joins them.

    So joined, a map is in one piece, and with as many neighbours as task coordinates it is made of simplices.
    """
    places = y / np.asarray(spacing)
    edges = [np.empty((0, 2), dtype=np.intp)]
    for vertex in range(1, len(y)):
        apart = ((places[:vertex] - places[vertex]) ** 2).sum(axis=1)
        found = np.arange(vertex)
        if count < vertex:  # a sort of all of them would take most of the time of a map by least squares
            near = np.flatnonzero(apart <= np.partition(apart, count - 1)[count - 1])
            found = near[np.argsort(apart[near], kind="stable")[:count]]
        edges.append(np.stack([found, np.full(len(found), vertex)], axis=1))
    return sorted_edges(np.concatenate(edges))


def short(q: Array, edges: Ints, longest: float | None) -> Ints:
    """The edges (E, 2) along which no motor turns by more than `longest` [rad]; None: all."""
    if longest is None:
        return edges
    steps = np.abs(q[edges[:, 0]] - q[edges[:, 1]]).max(axis=1, initial=0.0)
    kept: Ints = edges[steps <= longest]
    return kept


def sorted_edges(pairs: ArrayLike) -> Ints:
    """Pairs of vertices (P, 2) as the edges of a map: the lower vertex first, each once, sorted."""
    ordered = np.sort(np.asarray(pairs, dtype=np.intp).reshape(-1, 2), axis=1)
    return np.unique(ordered[ordered[:, 0] < ordered[:, 1]], axis=0)
