"""Ways through a map along which nothing touches: edges are checked when the shortest way leads over them, as in a lazy PRM."""

from __future__ import annotations

import numpy as np

from mobee.errors import MobeeError
from mobee.model import Model
from mobee.roadmap.edges import check_edges
from mobee.roadmap.graph import Graph, graph
from mobee.robot.robot import Array, Ints

ENTRIES, EXITS = 24, 8  # vertices at which the map is tried to be entered and left
LAZY = 30  # searches after which all the edges that are left are checked at once


def free_way(model: Model, roads: Graph, edges: Ints, start: Array, to_enter: Array, to_leave: Array) -> list[int]:
    """The vertices of a free way from the posture `start` (n,) rad over the map, by the first of its vertices that can be reached.

    `to_enter`, `to_leave`: (V,) how far each vertex is from the start, and from the goal; infinite: it is none.  Raises MobeeError
    where no way is free, with why.
    """
    exits = _nearest(to_leave, EXITS)
    exits = exits[np.asarray(model.evaluate(roads.q[exits]).count) == 0]
    if not len(exits):
        raise MobeeError("no free way: something touches in all poses of the map that are near the goal.")
    search = _Search(model, roads, edges)
    entered = 0
    for first in _nearest(to_enter, ENTRIES).tolist():
        if not check_edges(model, np.stack([start, roads.q[first]]), np.array([[0, 1]]))[0]:
            continue
        entered += 1
        for goal in exits.tolist():
            if (way := search.way(first, goal)) is not None:
                return way
    if not entered:
        raise MobeeError(f"no free way: the straight ones from the start to the {ENTRIES} nearest poses of the map all touch something.")
    raise MobeeError(
        f"no free way: {len(search.touching)} of {len(edges)} edges touch something, and without them none leads from the {entered} poses "
        f"near the start that can be reached to the {len(exits)} near the goal."
    )


class _Search:
    """Shortest ways over edges of which it is found out one after the other whether they are free."""

    def __init__(self, model: Model, roads: Graph, edges: Ints) -> None:
        self._model, self._graph, self._edges = model, roads, edges
        self._free: set[tuple[int, int]] = set()
        self.touching: set[tuple[int, int]] = set()
        self._searches = 0
        self._known: Graph | None = None  # of the free edges, once all are known

    def way(self, start: int, goal: int) -> list[int] | None:
        if self._known is None and self._graph.components[start] == self._graph.components[goal]:
            way = self._lazily(start, goal)
            if way is not None:
                return way
            self._check_all()
        return None if self._known is None else self._known.shortest(start, goal)

    def _lazily(self, start: int, goal: int) -> list[int] | None:
        """A free way, or None if there is none, or if it is quicker to check all."""
        while self._searches < LAZY and (way := self._graph.shortest(start, goal, self.touching)) is not None:
            steps = {(min(a, b), max(a, b)) for a, b in zip(way, way[1:], strict=False)}
            if steps <= self._free:
                return way
            self._searches += 1
            hit = self._check(steps)
            while hit:  # what is in the way of an edge is likely to be in that of its neighbours
                hit = self._check({pair for edge in hit for vertex in edge for pair in self._around(vertex)})
        return None

    def _check_all(self) -> None:
        self._check({(a, b) for a, b in self._edges.tolist()})
        self._known = graph(self._graph.q, np.array(sorted(self._free), dtype=np.intp).reshape(-1, 2))

    def _around(self, vertex: int) -> list[tuple[int, int]]:
        return [(min(vertex, other), max(vertex, other)) for other in self._graph.neighbours[vertex]]

    def _check(self, edges: set[tuple[int, int]]) -> list[tuple[int, int]]:
        """Find out about edges; returns those that turn out to touch something."""
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
