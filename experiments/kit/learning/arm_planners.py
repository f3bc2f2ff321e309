# SPDX-License-Identifier: Apache-2.0
"""Planners that are compared with each other: straight motions, a roadmap planned once or replanned, and a learned MDP."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Protocol

import numpy as np

from experiments.kit.learning.arm_roadmap import Edge, Roadmap, edge
from mobee import Lattice, TransitionModel
from mobee.arrays import Array
from mobee.learning.planner import Planner

ARRIVED = 0.125  # of every joint's range: half the distance of two samples of the lattice


class Rival(Protocol):
    """A planner that chooses the next pose to go to, and observes the outcome."""

    repairs: int
    """Number of actions so far that did not end as planned."""

    def begin(self, goal: int) -> None:
        """Begin a new query for a goal state of the lattice."""

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad to go to from q; None: the planner gives up."""

    def observe(self, start: Array, end: Array) -> None:
        """Observe the poses (4,) rad in which the last motion started and ended."""


class Straight:
    """Goes straight to the goal, repeatedly."""

    repairs = 0

    def __init__(self, space: Lattice) -> None:
        self._space, self._goal = space, 0

    def begin(self, goal: int) -> None:
        """See Rival."""
        self._goal = goal

    def aim(self, q: Array) -> Array | None:
        """See Rival."""
        sample: Array = self._space.samples[self._goal]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """See Rival."""


class PlannedOnce:
    """Plans one path through a roadmap and sends the robot to its vertices, wherever the motions end: plan first, act later."""

    repairs = 0

    def __init__(self, roadmap: Roadmap, vertex_of: dict[int, int], neighbours: int) -> None:
        self._roadmap, self._vertex_of, self._neighbours = roadmap, vertex_of, neighbours
        self._goal = 0
        self._left: Iterator[int] | None = None

    def begin(self, goal: int) -> None:
        """See Rival."""
        self._goal, self._left = self._vertex_of[goal], None

    def aim(self, q: Array) -> Array | None:
        """See Rival."""
        if self._left is None:
            near = self._roadmap.reachable(q, self._neighbours)
            path = self._roadmap.path({v: self._roadmap.cost(q, v) for v in near}, self._goal, ())
            self._left = iter(path or ())
        vertex = next(self._left, None)
        return None if vertex is None else self._roadmap.pose(vertex)

    def observe(self, start: Array, end: Array) -> None:
        """See Rival."""


class Repaired:
    """Follows the cheapest path through a roadmap; a motion that fails is removed, and the path is planned again (thesis 4.2).

    Args:
        roadmap: the roadmap, which is not changed.
        vertex_of: the vertex of each goal state.
        neighbours: number of near vertices to which it may return after it was pushed off the roadmap.
        remembers: whether removed motions stay removed in the next query.
    """

    def __init__(self, roadmap: Roadmap, vertex_of: dict[int, int], neighbours: int, remembers: bool) -> None:
        self._roadmap, self._vertex_of, self._neighbours, self._remembers = roadmap, vertex_of, neighbours, remembers
        self._out: set[Edge] = set()
        self._goal = self._to = 0
        self._at: int | None = None
        self.repairs = 0

    def begin(self, goal: int) -> None:
        """See Rival."""
        self._goal, self._at = self._vertex_of[goal], None
        if not self._remembers:
            self._out.clear()

    def aim(self, q: Array) -> Array | None:
        """See Rival."""
        path = self._path(q)
        if not path:  # too many motions were removed: some fail only sometimes
            self._out.clear()
            path = self._path(q)
        if not path:
            return None
        self._to = path[0]
        return self._roadmap.pose(self._to)

    def observe(self, start: Array, end: Array) -> None:
        """See Rival."""
        off = np.abs((end - self._roadmap.pose(self._to)) / self._roadmap.belief.span)
        if off.max() <= ARRIVED:
            self._at = self._to
            return
        self._out.add(self._edge(start, self._to))
        self._at = None
        self.repairs += 1

    def _path(self, q: Array) -> list[int] | None:
        """Return the remaining vertices; the goal vertex is passed again if the robot is near it but not in the goal's cell."""
        roadmap = self._roadmap
        if self._at is not None and self._at != self._goal:
            path = roadmap.path({self._at: 0.0}, self._goal, self._out)
            return None if path is None else path[1:]
        starts = [v for v in roadmap.reachable(q, self._neighbours) if self._edge(q, v) not in self._out]
        return roadmap.path({v: roadmap.cost(q, v) for v in starts}, self._goal, self._out)

    def _edge(self, q: Array, vertex: int) -> Edge:
        """Return the motion from q to a vertex; off the roadmap its start is the nearest vertex v, numbered -1 - v."""
        return edge(self._at, vertex) if self._at is not None else (-1 - self._roadmap.nearest(q, 1)[0], vertex)


class Learned:
    """Follows the plan of a learned transition model, which is updated and planned with after every action."""

    def __init__(self, space: Lattice, model: TransitionModel) -> None:
        self._space, self._model = space, model
        self._goal = self._action = 0
        self.repairs = 0

    def begin(self, goal: int) -> None:
        """See Rival."""
        self._goal = goal

    def aim(self, q: Array) -> Array | None:
        """See Rival."""
        state = self._space.state_of(q)
        self._action = int(Planner(self._space, self._model.debiased(), [self._goal]).policy[state])
        sample: Array = self._space.samples[self._space.goal(state, self._action)]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """See Rival."""
        before, after = self._space.state_of(start), self._space.state_of(end)
        self.repairs += after != self._space.goal(before, self._action)
        self._model.observe(before, self._action, after)
