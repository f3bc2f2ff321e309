# SPDX-License-Identifier: Apache-2.0
"""The graph of a roadmap: neighbours, shortest paths (A*), and shortest free paths with lazily checked edges."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.model.model import Model
from mobee.roadmap.edges import check_edges


def nearest(y: Array, spacing: ArrayLike, count: int) -> Ints:
    """Return edges (E, 2) from each of V vertices to the `count` vertices nearest to it.

    `y`: (V, m) coordinates of the vertices. `spacing`: the difference in each coordinate that counts as distance 1, (m,), or one number for
    all: distances are Euclidean in y / spacing. Each edge occurs once, its lower vertex first; the edges are sorted by the first vertex,
    then by the second. Raises InvalidValue if `count` is below 1.
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
    others = [
        row[row != vertex][:most] for vertex, row in enumerate(found)
    ]  # vertices at equal places may be sorted before the vertex itself
    return sorted_edges(np.stack([np.repeat(own, most), np.concatenate(others)], axis=1))


def nearest_before(y: Array, spacing: ArrayLike, count: int) -> Ints:
    """Return edges (E, 2) from each of V vertices to the `count` nearest vertices with a lower number, as in thesis Algorithm 4.

    `y`: (V, m) coordinates of the vertices. `spacing`: the difference in each coordinate that counts as distance 1, (m,), or one number for
    all: distances are Euclidean in y / spacing. The graph is connected. With `count` = m, a vertex and these m vertices are the m + 1
    corners of a simplex (m = 2: a triangle). Each edge occurs once, its lower vertex first; the edges are sorted by the first vertex, then
    by the second.
    """
    places = y / np.asarray(spacing)
    edges = [np.empty((0, 2), dtype=np.intp)]
    for vertex in range(1, len(y)):
        apart = ((places[:vertex] - places[vertex]) ** 2).sum(axis=1)
        found = np.arange(vertex)
        if count < vertex:  # sorting all distances would take most of the time to build a map by least squares
            near = np.flatnonzero(apart <= np.partition(apart, count - 1)[count - 1])
            found = near[np.argsort(apart[near], kind="stable")[:count]]
        edges.append(np.stack([found, np.full(len(found), vertex)], axis=1))
    return sorted_edges(np.concatenate(edges))


def short(q: Array, edges: Ints, longest: float | None) -> Ints:
    """Return those of the edges (E, 2) between poses q (V, n) rad on which no motor turns by more than `longest` [rad].

    `longest` None: all edges are returned.
    """
    if longest is None:
        return edges
    steps = np.abs(q[edges[:, 0]] - q[edges[:, 1]]).max(axis=1, initial=0.0)
    kept: Ints = edges[steps <= longest]
    return kept


def sorted_edges(pairs: ArrayLike) -> Ints:
    """Return pairs of vertices (P, 2) as edges (E, 2), the lower vertex first, without repetitions and without loops.

    The edges are sorted by the first vertex, then by the second.
    """
    ordered = np.sort(np.asarray(pairs, dtype=np.intp).reshape(-1, 2), axis=1)
    return np.unique(ordered[ordered[:, 0] < ordered[:, 1]], axis=0)


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """An undirected graph over V vertices.

    `q`: (V, n) rad, the pose of each vertex. `neighbours`: for each vertex the list of vertices that an edge joins to it. `lengths`: the
    Euclidean lengths [rad] of these edges, in the same order. `components`: (V,) index of the connected component of each vertex, 0 for the
    largest component.
    """

    q: Array
    neighbours: list[list[int]]
    lengths: list[list[float]]
    components: Ints

    def shortest(self, start: int, goal: int, without: Set[tuple[int, int]] = frozenset()) -> list[int] | None:
        """Return the vertices of the shortest path from `start` to `goal`, both included; None if there is no path.

        `without`: edges that the path must not use, as pairs (lower vertex, higher vertex).
        """
        if self.components[start] != self.components[goal]:
            return None
        ahead = np.linalg.norm(self.q - self.q[goal], axis=1).tolist()  # lower bounds of the remaining lengths
        best, before = [inf] * len(self.q), [-1] * len(self.q)
        best[start] = 0.0
        queue = [(ahead[start], 0.0, start)]
        while queue:
            _, here, vertex = heappop(queue)
            if vertex == goal:
                break
            if here > best[vertex]:
                continue
            for other, length in zip(self.neighbours[vertex], self.lengths[vertex], strict=True):
                total = here + length
                if total < best[other] and not (without and (min(vertex, other), max(vertex, other)) in without):
                    best[other], before[other] = total, vertex
                    heappush(queue, (total + ahead[other], total, other))
        if best[goal] == inf:
            return None
        path = [goal]
        while path[-1] != start:
            path.append(before[path[-1]])
        return path[::-1]


def graph(q: Array, edges: Ints) -> Graph:
    """Return the graph of undirected edges (E, 2) between poses q (V, n) rad, with Euclidean lengths [rad]."""
    count = len(q)
    ends = np.concatenate([edges, edges[:, ::-1]])
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends = ends[order]
    lengths = np.linalg.norm(q[ends[:, 0]] - q[ends[:, 1]], axis=1).tolist()
    others = ends[:, 1].tolist()
    starts = np.searchsorted(ends[:, 0], np.arange(count + 1)).tolist()
    pieces = [slice(first, last) for first, last in zip(starts, starts[1:], strict=False)]
    return Graph(q, [others[one] for one in pieces], [lengths[one] for one in pieces], components(count, edges))


def components(count: int, edges: Ints) -> Ints:
    """Return the index of the connected component of each of `count` vertices, (count,), for a graph with the edges (E, 2).

    Components are sorted by size: 0 is the largest; of equally large ones, the component with the lowest vertex comes first.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ones = np.ones(len(edges), dtype=np.int8)
    _, label = connected_components(coo_array((ones, (edges[:, 0], edges[:, 1])), shape=(count, count)), directed=False)
    sizes = np.bincount(label)
    rank = np.empty(len(sizes), dtype=np.intp)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    found: Ints = rank[label]
    return found


MOST_NAMED = 3  # contacts in an error
ENTRIES, EXITS = 24, 8  # numbers of vertices that are tried as the first and the last of a path
MAX_LAZY_SEARCHES = 30  # after so many searches all unchecked edges are checked at once


def free_path(model: Model, roads: Graph, edges: Ints, start: Array, to_enter: Array, to_leave: Array) -> list[int]:
    """Return the vertices of a path without contacts from a posture to a goal.

    A straight line leads from the start to the first vertex. The vertices near the start are tried in order of distance. The first vertex
    is the nearest one whose line has no contacts and from which a path exists.

    Args:
        model: robot and world.
        roads: the graph of the roadmap.
        edges: (E, 2) all edges of the graph, the lower vertex first.
        start: (n,) rad.
        to_enter: (V,) distances of the vertices from the start; infinite: the vertex is not used as the first one.
        to_leave: (V,) distances of the vertices from the goal; infinite: the vertex is not used as the last one.

    Raises:
        MobeeError: every path has contacts; the message states the reason.
    """
    exits = _nearest(to_leave, EXITS)
    exits = exits[np.asarray(model.evaluate(roads.q[exits]).count) == 0]
    if not len(exits):
        raise MobeeError("no path without contacts: all poses of the map near the goal have contacts.")
    search = _Search(model, roads, edges)
    entered = 0
    for first in _nearest(to_enter, ENTRIES).tolist():
        if not check_edges(model, np.stack([start, roads.q[first]]), np.array([[0, 1]]))[0]:
            continue
        entered += 1
        for goal in exits.tolist():
            if (path := search.path(first, goal)) is not None:
                return path
    if not entered:
        touch = [f"{one.first} and {one.second}" for one in model.evaluate(start).contacts if one.kind == "solid"]
        raise MobeeError(
            f"no path without contacts: the straight lines from the start to the {ENTRIES} nearest poses of the map all have contacts"
            + (f", since {', '.join(touch[:MOST_NAMED])} touch in the start itself." if touch else ".")
        )
    raise MobeeError(
        f"no path without contacts: {len(search.touching)} of {len(edges)} edges have contacts, and the other edges do not connect the "
        f"{entered} reachable poses near the start with the {len(exits)} poses near the goal."
    )


class _Search:
    """Finds shortest paths over edges that are checked for contacts only when a path needs them."""

    def __init__(self, model: Model, roads: Graph, edges: Ints) -> None:
        self._model, self._graph, self._edges = model, roads, edges
        self._free: set[tuple[int, int]] = set()
        self.touching: set[tuple[int, int]] = set()
        self._searches = 0
        self._known: Graph | None = None  # of the free edges, once all are known

    def path(self, start: int, goal: int) -> list[int] | None:
        """Return the vertices of the shortest path without contacts; None if there is none."""
        if self._known is None and self._graph.components[start] == self._graph.components[goal]:
            path = self._lazily(start, goal)
            if path is not None:
                return path
            self._check_all()
        return None if self._known is None else self._known.shortest(start, goal)

    def _lazily(self, start: int, goal: int) -> list[int] | None:
        """Return a path without contacts; None if there is none, or if checking all edges is faster."""
        while self._searches < MAX_LAZY_SEARCHES and (path := self._graph.shortest(start, goal, self.touching)) is not None:
            steps = {(min(a, b), max(a, b)) for a, b in zip(path, path[1:], strict=False)}
            if steps <= self._free:
                return path
            self._searches += 1
            hit = self._check(steps)
            while hit:  # an obstacle on one edge is probably on the edges beside it too
                hit = self._check({pair for edge in hit for vertex in edge for pair in self._around(vertex)})
        return None

    def _check_all(self) -> None:
        self._check({(a, b) for a, b in self._edges.tolist()})
        self._known = graph(self._graph.q, np.array(sorted(self._free), dtype=np.intp).reshape(-1, 2))

    def _around(self, vertex: int) -> list[tuple[int, int]]:
        return [(min(vertex, other), max(vertex, other)) for other in self._graph.neighbours[vertex]]

    def _check(self, edges: set[tuple[int, int]]) -> list[tuple[int, int]]:
        """Check edges; return those that have contacts."""
        unknown = sorted(edges - self._free - self.touching)
        if not unknown:
            return []
        free = check_edges(self._model, self._graph.q, np.array(unknown, dtype=np.intp))
        self._free.update(edge for edge, passes in zip(unknown, free.tolist(), strict=True) if passes)
        hit = [edge for edge, passes in zip(unknown, free.tolist(), strict=True) if not passes]
        self.touching.update(hit)
        return hit


def _nearest(far: Array, count: int) -> Ints:
    order: Ints = np.argsort(far, kind="stable")[:count]
    return order[np.isfinite(far[order])]
