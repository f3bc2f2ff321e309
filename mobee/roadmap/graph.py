"""The graph of a map, and the shortest way through it (A*)."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from heapq import heappop, heappush
from math import inf

import numpy as np

from mobee.robot.robot import Array, Ints


@dataclass(frozen=True, slots=True, eq=False)
class Graph:
    """Places q (V, n), and at each vertex its neighbours and how far they are."""

    q: Array
    neighbours: list[list[int]]
    lengths: list[list[float]]
    components: Ints  # (V,) which connected part a vertex belongs to, the largest is 0

    def shortest(self, start: int, goal: int, without: Set[tuple[int, int]] = frozenset()) -> list[int] | None:
        """The vertices of the shortest way from one to the other, both included; None where there is none.

        `without`: edges that are not gone, the lower vertex first.
        """
        if self.components[start] != self.components[goal]:
            return None
        ahead = np.linalg.norm(self.q - self.q[goal], axis=1).tolist()  # never more than the way that is left
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
                way = here + length
                if way < best[other] and not (without and (min(vertex, other), max(vertex, other)) in without):
                    best[other], before[other] = way, vertex
                    heappush(queue, (way + ahead[other], way, other))
        if best[goal] == inf:
            return None
        path = [goal]
        while path[-1] != start:
            path.append(before[path[-1]])
        return path[::-1]


def graph(q: Array, edges: Ints) -> Graph:
    """The graph of undirected edges (E, 2) between places q (V, n); an edge is as long as its straight line."""
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
    """Which connected part each of `count` vertices belongs to, (count,): 0 is the largest, of equal ones that of the first vertex."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ones = np.ones(len(edges), dtype=np.int8)
    _, label = connected_components(coo_array((ones, (edges[:, 0], edges[:, 1])), shape=(count, count)), directed=False)
    sizes = np.bincount(label)
    rank = np.empty(len(sizes), dtype=np.intp)
    rank[np.argsort(-sizes, kind="stable")] = np.arange(len(sizes))
    found: Ints = rank[label]
    return found
