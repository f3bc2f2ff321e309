"""Planners that follow their plans action by action: straight, along a roadmap planned once or repaired, or by a learned MDP."""

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
    """Chooses the next pose to go to, and observes the outcome."""

    repairs: int
    """How often an action did not end as planned, so far."""

    def begin(self, goal: int) -> None:
        """A new query, to a state of the lattice."""

    def aim(self, q: Array) -> Array | None:
        """The pose (4,) rad to go to from here; None: it gives up."""

    def observe(self, start: Array, end: Array) -> None:
        """The poses (4,) rad from which the robot was sent to the last aim, and in which it ended."""


class Straight:
    """Goes straight to the goal, again and again."""

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
    """Plans a path through a roadmap and passes its vertices, wherever the robot comes to rest: plan first, act later."""

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
    """Follows the cheapest path through a roadmap; a motion that fails is taken out, and the path is planned anew (thesis 4.2).

    Args:
        roadmap: which is not changed.
        vertex_of: the vertex of every goal.
        neighbours: to how many near vertices it may return when it has been pushed off the roadmap.
        remembers: whether the motions taken out stay out when a new query begins.
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
        if not path:  # too much was taken out, for some motions fail but now and then
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
        """The vertices still to pass; the goal's own is passed again if the robot rests near it and yet not in the goal's cell."""
        roadmap = self._roadmap
        if self._at is not None and self._at != self._goal:
            path = roadmap.path({self._at: 0.0}, self._goal, self._out)
            return None if path is None else path[1:]
        starts = [v for v in roadmap.reachable(q, self._neighbours) if self._edge(q, v) not in self._out]
        return roadmap.path({v: roadmap.cost(q, v) for v in starts}, self._goal, self._out)

    def _edge(self, q: Array, vertex: int) -> Edge:
        """The motion from here to a vertex; beside the roadmap, from the vertex that is nearest, which has a negative number then."""
        return edge(self._at, vertex) if self._at is not None else (-1 - self._roadmap.nearest(q, 1)[0], vertex)


class Learned:
    """Follows the plan of a learned transition model, made anew after every action, and goes on learning."""

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
