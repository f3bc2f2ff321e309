"""A roadmap: poses, the motions between them that are believed to be sound, and the shortest way through."""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable

import numpy as np

from experiments.prm_vs_mdp.belief import Belief
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

Edge = tuple[int, int]  # vertices, the smaller first


class Roadmap:
    """An undirected graph of V vertices, poses of the arm (V, 4) rad.

    A motion costs as much as an action, 1, and its length in fractions of the joints' ranges.
    """

    def __init__(self, vertices: Array, edges: Iterable[Edge], belief: Belief) -> None:
        self.vertices, self.belief = vertices, belief
        if not len(vertices):
            raise InvalidValue("a roadmap without vertices: no sample was believed to be sound.")
        self._costs: list[dict[int, float]] = [{} for _ in vertices]
        for first, second in edges:
            self._join(first, second)

    @property
    def edges(self) -> int:
        """How many there are."""
        return sum(len(costs) for costs in self._costs) // 2

    def pose(self, vertex: int) -> Array:
        """Of a vertex, (4,) rad."""
        pose: Array = self.vertices[vertex]
        return pose

    def add(self, pose: Array, neighbours: int) -> int:
        """Add a vertex and its motions to and from the nearest ones that are `reachable`; returns its number."""
        joined = self.reachable(pose, neighbours)
        self.vertices = np.concatenate([self.vertices, pose[None]])
        self._costs.append({})
        for vertex in joined:
            self._join(len(self.vertices) - 1, vertex)
        return len(self.vertices) - 1

    def nearest(self, pose: Array, count: int) -> list[int]:
        """The nearest vertices, by the distance in fractions of the ranges."""
        return [int(v) for v in np.argsort(self._lengths(pose), kind="stable")[:count]]

    def reachable(self, pose: Array, neighbours: int) -> list[int]:
        """Those of the nearest vertices to which the straight motion is sound; if it is to none, is free of contacts; else all."""
        near = self.nearest(pose, neighbours)
        for cables in (True, False):  # a pose that is asked for may be held by the cables and be reached all the same
            found = [v for v in near if self.belief.is_sound_motion(pose, self.vertices[v], cables)]
            if found:
                return found
        return near

    def way(self, starts: dict[int, float], goal: int, blocked: Collection[Edge]) -> list[int] | None:
        """The cheapest vertices to pass, from one of the starts (with what it costs to get there) to the goal; None if there is no way."""
        best, before = dict(starts), dict.fromkeys(starts, -1)
        queue = [(cost, vertex) for vertex, cost in starts.items()]
        heapq.heapify(queue)
        while queue:
            cost, vertex = heapq.heappop(queue)
            if vertex == goal:
                way = [vertex]
                while before[way[-1]] >= 0:
                    way.append(before[way[-1]])
                return way[::-1]
            if cost > best[vertex]:
                continue
            for other, more in self._costs[vertex].items():
                if cost + more < best.get(other, np.inf) and edge(vertex, other) not in blocked:
                    best[other], before[other] = cost + more, vertex
                    heapq.heappush(queue, (cost + more, other))
        return None

    def cost(self, pose: Array, vertex: int) -> float:
        """Of the motion from a pose to a vertex."""
        return 1.0 + float(np.linalg.norm((self.vertices[vertex] - pose) / self.belief.span))

    def _lengths(self, pose: Array) -> Array:
        lengths: Array = np.linalg.norm((self.vertices - pose) / self.belief.span, axis=1)
        return lengths

    def _join(self, first: int, second: int) -> None:
        cost = self.cost(self.vertices[first], second)
        self._costs[first][second] = self._costs[second][first] = cost


def edge(first: int, second: int) -> Edge:
    """The edge between two vertices, whichever way it is passed."""
    return (first, second) if first < second else (second, first)
