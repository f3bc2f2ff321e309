# SPDX-License-Identifier: Apache-2.0
"""Roadmaps of the left arm of the robot published in 2014 (four joints), and planners that are compared with each other.

Vertices and edges of a roadmap are poses and motions that are free in the planner's own model of robot and world.  The graph is OMPL's PRM
or the lattice of states on which the learners act.  The planners are: straight motions, a roadmap planned once, a roadmap replanned after
failures, and a learned MDP.
"""

from __future__ import annotations

import heapq
from collections.abc import Collection, Iterable, Iterator, Sequence
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from experiments.kit.learning.arm import clear, columns, robot
from mobee import Gains, Lattice, Model, TransitionModel
from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.planner import Planner
from mobee.roadmap.ompl import grown
from mobee.robot.robot import Clause

STEP = 0.02  # of a joint's range, between two poses of a motion that are checked
MILESTONES, NEIGHBOURS = 300, 10  # of OMPL's roadmap; the second is its default
KINDS = ("OMPL", "lattice")
ARRIVED = 0.125  # of every joint's range: half the distance of two samples of the lattice


Edge = tuple[int, int]  # vertices, the smaller first


class Belief:
    """A planner's model of robot and world; a pose of the arm is sound if it is clear of contacts and cable constraints.

    The class implements `mobee.roadmap.ompl.ValidityChecker`.

    Args:
        model: the robot in the world, as the planner believes it to be.
        turns: (4,) rad, believed minus measured joint angles.
        clauses: the constraints of the cables that the planner knows.
    """

    def __init__(self, model: Model, turns: Array, clauses: Sequence[Clause]) -> None:
        self._model, self._turns, self._clauses = model, turns, clauses
        limits = robot().limits[columns()]
        self.box: Array = limits + np.array([1.0, -1.0]) * Gains.published_2014().limit_width
        """(4, 2) rad, lowest and highest angles between which the joint limits exert no force."""
        self.low: Array = self.box[:, 0]
        self.span: Array = np.ptp(limits, axis=1)
        """(4,) rad, widths of the joints' ranges."""
        self.checked = 0
        """Number of poses that were checked so far."""

    def sound(self, q: Array, cables: bool = True) -> NDArray[np.bool_]:
        """Return which of the poses (P, 4) rad of the arm are sound, (P,): clear of contacts and of the known cable constraints.

        `cables`: whether the cable constraints count.
        """
        self.checked += len(q)
        return clear(self._model, q + self._turns, self._clauses if cables else ())

    def sound_motion(self, start: Array, end: Array, cables: bool = True) -> bool:
        """Return whether all poses on the straight path between two poses (4,) rad are sound: clear of contacts and cable constraints.

        `start`, `end`: the two poses; the start pose is not checked.  `cables`: whether the cable constraints count.
        """
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / STEP)))
        shares = np.arange(1, count + 1)[:, None] / count
        return bool(self.sound(start + shares * (end - start), cables).all())


class Roadmap:
    """An undirected graph of V vertices, which are poses of the arm (V, 4) rad.

    The cost of a motion is 1, for the action, plus the length of the motion in fractions of the joints' ranges.  `belief`: the planner's
    model, in which motions are checked when a vertex is added or the graph is entered from a pose.
    """

    def __init__(self, vertices: Array, edges: Iterable[Edge], belief: Belief) -> None:
        self.vertices, self.belief = vertices, belief
        if not len(vertices):
            raise InvalidValue("a roadmap without vertices: no sample is sound in the planner's model.")
        self._costs: list[dict[int, float]] = [{} for _ in vertices]
        for first, second in edges:
            self._join(first, second)

    @property
    def edges(self) -> int:
        """The number of edges."""
        return sum(len(costs) for costs in self._costs) // 2

    def pose(self, vertex: int) -> Array:
        """Return the pose (4,) rad of a vertex, given by its index in `vertices`."""
        pose: Array = self.vertices[vertex]
        return pose

    def add(self, pose: Array, neighbours: int) -> int:
        """Add a pose (4,) rad as a vertex, with edges to the vertices that `reachable` returns for `neighbours`; returns its index."""
        joined = self.reachable(pose, neighbours)
        self.vertices = np.concatenate([self.vertices, pose[None]])
        self._costs.append({})
        for vertex in joined:
            self._join(len(self.vertices) - 1, vertex)
        return len(self.vertices) - 1

    def nearest(self, pose: Array, count: int) -> list[int]:
        """Return the indices of the `count` vertices nearest to a pose (4,) rad; distances are in fractions of the joints' ranges."""
        return [int(v) for v in np.argsort(self._lengths(pose), kind="stable")[:count]]

    def reachable(self, pose: Array, neighbours: int) -> list[int]:
        """Return the indices of vertices near a pose (4,) rad that can be reached from it by a straight motion.

        The `neighbours` nearest vertices are examined.  Those are returned to which the motion is sound: clear of contacts and cable
        constraints in the planner's model.  If there is none, the cable constraints are ignored.  If there is still none, all of the
        examined vertices are returned.
        """
        near = self.nearest(pose, neighbours)
        for cables in (True, False):  # a pose that violates the cable constraints may still be reached
            found = [v for v in near if self.belief.sound_motion(pose, self.vertices[v], cables)]
            if found:
                return found
        return near

    def path(self, starts: dict[int, float], goal: int, blocked: Collection[Edge]) -> list[int] | None:
        """Return the vertices of the cheapest path to the vertex `goal`, its start included; None if there is no path.

        `starts`: vertices from which the path may start, each with the cost to reach it.  `blocked`: edges that must not be used.
        """
        best, before = dict(starts), dict.fromkeys(starts, -1)
        queue = [(cost, vertex) for vertex, cost in starts.items()]
        heapq.heapify(queue)
        while queue:
            cost, vertex = heapq.heappop(queue)
            if vertex == goal:
                path = [vertex]
                while before[path[-1]] >= 0:
                    path.append(before[path[-1]])
                return path[::-1]
            if cost > best[vertex]:
                continue
            for other, more in self._costs[vertex].items():
                if cost + more < best.get(other, np.inf) and edge(vertex, other) not in blocked:
                    best[other], before[other] = cost + more, vertex
                    heapq.heappush(queue, (cost + more, other))
        return None

    def cost(self, pose: Array, vertex: int) -> float:
        """Return the cost of the straight motion from a pose (4,) rad to a vertex: 1 plus its length in fractions of the joints' ranges."""
        return 1.0 + float(np.linalg.norm((self.vertices[vertex] - pose) / self.belief.span))

    def _lengths(self, pose: Array) -> Array:
        lengths: Array = np.linalg.norm((self.vertices - pose) / self.belief.span, axis=1)
        return lengths

    def _join(self, first: int, second: int) -> None:
        cost = self.cost(self.vertices[first], second)
        self._costs[first][second] = self._costs[second][first] = cost


def edge(first: int, second: int) -> Edge:
    """Return the undirected edge between the vertices `first` and `second`: a pair with the smaller number first."""
    return (first, second) if first < second else (second, first)


def make_roadmap(kind: str, belief: Belief, lattice: Lattice, seed: int) -> Roadmap:
    """Build a roadmap whose motions are all sound in the planner's model: clear of contacts and of the cable constraints that it knows.

    `kind`: "OMPL": a PRM with 300 vertices; "lattice": the vertices are the poses of the lattice's states, and the edges are its actions,
    as far as they are sound.  `seed`: seed of the PRM.
    """
    if kind == "OMPL":
        return ompl_roadmap(belief, MILESTONES, NEIGHBOURS, seed)
    samples = np.flatnonzero(belief.sound(lattice.samples))
    vertex = {int(state): number for number, state in enumerate(samples)}
    wanted = {edge(vertex[s], vertex[int(g)]) for s in vertex for g in lattice.actions(s) if int(g) in vertex}
    poses = lattice.samples[samples]
    return Roadmap(poses, [(v, w) for v, w in sorted(wanted) if belief.sound_motion(poses[v], poses[w])], belief)


def with_goals(roadmap: Roadmap, lattice: Lattice, goals: Ints) -> dict[int, int]:
    """Add a vertex to the roadmap for each lattice state in `goals` that has none yet; returns a dict from the state to its vertex number.

    The vertex of a state is its sample, the pose (4,) rad in the middle of the state's cell.
    """
    found = {}
    for state in sorted({int(goal) for goal in goals}):
        sample = lattice.samples[state]
        here = roadmap.nearest(sample, 1)[0]
        found[state] = here if np.array_equal(roadmap.vertices[here], sample) else roadmap.add(sample, NEIGHBOURS)
    return found


def ompl_roadmap(belief: Belief, milestones: int, neighbours: int, seed: int) -> Roadmap:
    """Build a PRM over the arm's four joints with OMPL; distances are in fractions of the joints' ranges.  Raises OmplMissing.

    `milestones`: number of vertices.  `neighbours`: number of nearest vertices to which each vertex is joined if the motion is sound.
    `seed`: of the samples.
    """
    found = grown("PRM", belief, milestones, neighbours, seed, resolution=STEP)
    return Roadmap(found.q, [(v, w) for v, w in found.edges.tolist()], belief)


class Rival(Protocol):
    """A planner in a comparison: it chooses the next pose of the arm, and observes the outcome of the motion."""

    repairs: int
    """Number of actions so far that did not end as the planner expected; always 0 for a planner that learns nothing from outcomes."""

    def begin(self, goal: int) -> None:
        """Start a new query: reach the cell of the lattice state `goal`."""

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad to which the arm moves next from the pose q (4,) rad; None: the planner gives up."""

    def observe(self, start: Array, end: Array) -> None:
        """Take note of the outcome of the last motion; `start`, `end`: poses (4,) rad in which the motion started and ended."""


class Straight:
    """A `Rival` that moves straight to the sample of the goal state (the pose that stands for this state), again and again."""

    repairs = 0

    def __init__(self, space: Lattice) -> None:
        self._space, self._goal = space, 0

    def begin(self, goal: int) -> None:
        """Start a query for the state `goal`, as in `Rival.begin`."""
        self._goal = goal

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad that stands for the goal state, its sample in the lattice; never None.

        `q` is not used.
        """
        sample: Array = self._space.samples[self._goal]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """Do nothing: this planner learns nothing from the outcomes of motions (`Rival.observe`).

        `start`, `end`: as in that method.
        """


class PlannedOnce:
    """A `Rival` that plans one path through a roadmap and moves to its vertices one after the other, even if motions do not reach them.

    `vertex_of`: dict from each goal state to its vertex.  `neighbours`: the path may start at one of this number of nearest vertices.
    """

    repairs = 0

    def __init__(self, roadmap: Roadmap, vertex_of: dict[int, int], neighbours: int) -> None:
        self._roadmap, self._vertex_of, self._neighbours = roadmap, vertex_of, neighbours
        self._goal = 0
        self._left: Iterator[int] | None = None

    def begin(self, goal: int) -> None:
        """Start a query for the state `goal`, as in `Rival.begin`; the path is planned at the first call of `aim`."""
        self._goal, self._left = self._vertex_of[goal], None

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad of the next vertex of the path; None after the last vertex, or without a path, as in `Rival.aim`."""
        if self._left is None:
            near = self._roadmap.reachable(q, self._neighbours)
            path = self._roadmap.path({v: self._roadmap.cost(q, v) for v in near}, self._goal, ())
            self._left = iter(path or ())
        vertex = next(self._left, None)
        return None if vertex is None else self._roadmap.pose(vertex)

    def observe(self, start: Array, end: Array) -> None:
        """Do nothing: this planner does not react to the outcomes of motions (`Rival.observe`).

        `start`, `end`: as in that method.
        """


class Repaired:
    """A `Rival` that follows the cheapest path through a roadmap; a motion that fails is removed, and a new path planned (thesis 4.2).

    Args:
        roadmap: the roadmap, which is not changed.
        vertex_of: vertex of each goal state, by the state.
        neighbours: number of near vertices to which the arm may return after it was pushed off the roadmap.
        remembers: whether removed motions stay removed in the next query.
    """

    def __init__(self, roadmap: Roadmap, vertex_of: dict[int, int], neighbours: int, remembers: bool) -> None:
        self._roadmap, self._vertex_of, self._neighbours, self._remembers = roadmap, vertex_of, neighbours, remembers
        self._out: set[Edge] = set()
        self._goal = self._to = 0
        self._at: int | None = None
        self.repairs = 0

    def begin(self, goal: int) -> None:
        """Start a query for the state `goal`, as in `Rival.begin`.

        The motions that were removed in earlier queries because they failed are used again, unless `remembers` is set.
        """
        self._goal, self._at = self._vertex_of[goal], None
        if not self._remembers:
            self._out.clear()

    def aim(self, q: Array) -> Array | None:
        """Return the pose (4,) rad of the next vertex of the cheapest path from q (4,) rad, as in `Rival.aim`; None if there is no path.

        If there is no path without the removed motions, all of them are restored, and the path is planned again.
        """
        path = self._path(q)
        if not path:  # too many motions were removed: some fail only sometimes
            self._out.clear()
            path = self._path(q)
        if not path:
            return None
        self._to = path[0]
        return self._roadmap.pose(self._to)

    def observe(self, start: Array, end: Array) -> None:
        """Remove the last motion from later plans if it missed its vertex by more than 1/8 of a joint's range; `repairs` then grows by 1.

        `start`, `end`: poses (4,) rad in which the motion started and ended, as in `Rival.observe`.
        """
        off = np.abs((end - self._roadmap.pose(self._to)) / self._roadmap.belief.span)
        if off.max() <= ARRIVED:
            self._at = self._to
            return
        self._out.add(self._edge(start, self._to))
        self._at = None
        self.repairs += 1

    def _path(self, q: Array) -> list[int] | None:
        """Return the remaining vertices of the cheapest path to the goal, without removed motions; None if there is no path.

        At the goal vertex a query does not end until the robot is in the goal's cell: the path then starts at vertices near q, as off the
        roadmap, and may pass the goal vertex again.
        """
        roadmap = self._roadmap
        if self._at is not None and self._at != self._goal:
            path = roadmap.path({self._at: 0.0}, self._goal, self._out)
            return None if path is None else path[1:]
        starts = [v for v in roadmap.reachable(q, self._neighbours) if self._edge(q, v) not in self._out]
        return roadmap.path({v: roadmap.cost(q, v) for v in starts}, self._goal, self._out)

    def _edge(self, q: Array, vertex: int) -> Edge:
        """Return the motion from q (4,) rad to a vertex, as a pair of numbers.

        It is the edge from the present vertex.  If the robot is at no vertex, the first number is -1 - v, where v is the vertex nearest to
        q: such a motion must not be confused with the edge from v.
        """
        return edge(self._at, vertex) if self._at is not None else (-1 - self._roadmap.nearest(q, 1)[0], vertex)


class Learned:
    """A `Rival` that follows the plan of a learned transition model; after every action the model is updated, and a new plan is made."""

    def __init__(self, space: Lattice, model: TransitionModel) -> None:
        self._space, self._model = space, model
        self._goal = self._action = 0
        self.repairs = 0

    def begin(self, goal: int) -> None:
        """Start a query for the state `goal`, as in `Rival.begin`."""
        self._goal = goal

    def aim(self, q: Array) -> Array | None:
        """Plan the next action from the pose q (4,) rad, and return the sample of its goal state, a pose (4,) rad; never None.

        The sample of a state is the pose that stands for it.  The planned action is remembered for the next call of `observe`.
        """
        state = self._space.state_of(q)
        self._action = int(Planner(self._space, self._model.debiased(), [self._goal]).policy[state])
        sample: Array = self._space.samples[self._space.goal(state, self._action)]
        return sample

    def observe(self, start: Array, end: Array) -> None:
        """Update the transition model with the outcome of the last motion, as in `Rival.observe`.

        `start`, `end`: poses (4,) rad in which the motion started and ended.  The model learns the state of `start`, the action chosen by
        the last call of `aim`, and the state of `end`.  If this is not the goal state of the action, `repairs` is increased by 1.
        """
        before, after = self._space.state_of(start), self._space.state_of(end)
        self.repairs += after != self._space.goal(before, self._action)
        self._model.observe(before, self._action, after)
