# SPDX-License-Identifier: Apache-2.0
"""Adaptive roadmaps, whose edges count as free until a motion along them has failed, with beliefs about the edges (thesis 4.2, 9.4.5).

`roadmap_space` makes a roadmap the state space of an agent or of an adaptive roadmap.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, checked_count, real_array
from mobee.errors import InvalidValue, MobeeError, UnknownName
from mobee.learning.goal import target_states
from mobee.learning.neighbours import NO_ACTION, Edges, edges_of, joined, table_of
from mobee.learning.space import Space, checked_joints
from mobee.roadmap.roadmap import Roadmap

Mode = Literal["remove", "reweigh"]
MODES = ("remove", "reweigh")

PRIOR = (0.2, 0.01)  # imagined successes and failures of every edge: optimistic, and small compared with real observations
NEIGHBOURS = 10  # to which a new sample is joined (thesis 4.3.1)
BEYOND = 0.01  # rad or m that a sample may be beyond the limits, since encoders err
DECIMALS = 9  # of rad: poses that are equal to this precision are one


class AdaptiveRoadmap:
    """A roadmap whose edges are not checked for contacts in advance; it counts how often motions along each edge succeeded.

    It is a simple Markov decision process: states are vertices, actions are edges, and an action ends at the goal of its edge or at the
    vertex where it began. `space` is the graph (`mobee.learning.space.Space`, S vertices with at most A edges each); `beliefs` are the
    success probabilities of the edges (`EdgeBeliefs`). `mobee.Planner(space, beliefs, ...)` and `mobee.value_iteration(beliefs, ...)` plan
    with them, as with the space and the learned model of a curious agent. `plan` finds the same paths as value iteration, but faster: an
    edge of length d that succeeds with probability p costs d / p, since it needs 1 / p tries on average.

    Args:
        space: vertices and edges over joints of one part, e.g. `mobee.Voronoi(robot, joints, 20, neighbours=10)` or
            `mobee.roadmap_space(roadmap)`.
        mode: what happens to a failed edge. "remove": it is excluded until it succeeds again (thesis). "reweigh": its probability of
            success is estimated from counts.
        forgetting: factor in (0, 1] on all counts at each observation of any edge, so that old failures are forgotten; no effect with
            "remove".
        both_ways: whether an observation of an edge also counts for the edge in the opposite direction.

    Raises:
        InvalidValue, UnknownName: an argument is not valid; the message states the valid values.
    """

    def __init__(self, space: Space, mode: Mode = "remove", forgetting: float = 1.0, both_ways: bool = False) -> None:
        self.space = space
        self.both_ways = both_ways
        self.beliefs = EdgeBeliefs(space.goals, mode, forgetting)

    def __len__(self) -> int:
        return len(self.space)

    def __repr__(self) -> str:
        return f"<AdaptiveRoadmap of {self.space.part}: {len(self)} vertices, {self.space.state_actions} edges, {self.tried} tried>"

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments as plain JSON values, with the settings of the space."""
        beliefs = self.beliefs
        made = {"mode": beliefs.mode, "forgetting": beliefs.forgetting, "both_ways": self.both_ways}
        return made | {"space": self.space.settings}

    @property
    def tried(self) -> int:
        """Number of edges that were tried at least once."""
        return int((self.beliefs.tried > 0).sum())

    @property
    def unexplored(self) -> Ints:
        """The edges that were never tried, shape (E, 2): each row has the start vertex (state) and the action (column of `space.goals`)."""
        return np.argwhere((self.space.goals != NO_ACTION) & (self.beliefs.tried == 0))

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether each edge was tried and ended at its goal when it was last tried, shape (S, A)."""
        return (self.beliefs.tried > 0) & self.beliefs.last

    @property
    def stuck(self) -> Ints:
        """Indices of the vertices from which every edge was tried and failed at its last try (thesis 4.3.1)."""
        return np.flatnonzero(~self.beliefs.last.any(axis=1))

    @property
    def lengths(self) -> Array:
        """Lengths [rad] of the edges in joint space, (S, A): a row for each vertex, a column for each of its edges; 0: no edge."""
        space = self.space
        steps = space.samples[space.goals] - space.samples[:, None]
        return np.where(space.goals == NO_ACTION, 0.0, np.sqrt((steps**2).sum(axis=-1)))

    def plan(self, start: int, goals: ArrayLike) -> tuple[int, ...]:
        """Return the vertices of the cheapest path from vertex `start` to one of the vertices `goals`, start and goal included.

        The cost of an edge is its length divided by its probability of success. Raises InvalidValue for a vertex that does not exist, and
        MobeeError if no path is left because failed edges were removed.
        """
        here = int(target_states(self.space, start)[0])
        targets = set(target_states(self.space, goals).tolist())
        left, onward = self._search(goals)
        edges = self._edge_costs()
        if not np.isfinite(left[here]):
            raise MobeeError(
                f"the map has no path from vertex {here} to {sorted(targets)}, because edges that failed were removed. "
                "Grow the map, join its parts by a single query, or change the costs of failed edges instead of removing them."
            )
        path = [here]
        while path[-1] not in targets:
            row = self.space.goals[path[-1]]
            following = int(row[np.where(np.isfinite(edges[path[-1]]), edges[path[-1]] + left[row], np.inf).argmin()])
            # Edges between equal poses cost nothing: the cheapest could lead back and forth. The search's own tree has no circle.
            path.append(following if left[following] < left[path[-1]] else int(onward[path[-1]]))
        return tuple(path)

    def costs(self, goals: ArrayLike) -> Array:
        """Return the cost of the cheapest path from each vertex to one of the vertices `goals`, shape (S,).

        The cost of an edge is its length [rad] divided by its probability of success. The cost of a vertex from which no path is left is
        infinite.
        """
        return self._search(goals)[0]

    def reward(self, goals: ArrayLike) -> Array:
        """Return the reward (S vertices, A edges of each) for which value iteration finds the paths of `plan` to the vertices `goals`.

        The reward is minus the length of the edge [rad]. It is -inf for edges that are removed, that do not exist, that begin in a goal, or
        that begin or end at a vertex without a path to a goal.
        """
        left = self.costs(goals)
        usable = np.isfinite(self._edge_costs()) & np.isfinite(left)[self.space.goals] & np.isfinite(left)[:, None]
        usable[target_states(self.space, goals)] = False
        return np.where(usable, -self.lengths, -np.inf)

    def reachable(self, start: int) -> NDArray[np.bool_]:
        """Return whether each vertex can be reached from vertex `start` over edges that are not removed, (S,); True for `start` itself."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import breadth_first_order

        states, actions = np.nonzero(np.isfinite(self._edge_costs()))
        graph = csr_array((np.ones(len(states)), (states, self.space.goals[states, actions])), shape=(len(self), len(self)))
        found = np.zeros(len(self), dtype=bool)
        found[breadth_first_order(graph, int(target_states(self.space, start)[0]), return_predecessors=False)] = True
        return found

    def next_target(self, start: int, rng: np.random.Generator) -> int | None:
        """Draw the vertex to explore next, with a probability proportional to the number of its untried edges (thesis 4.3.1).

        Only vertices that can be reached from `start` are drawn. Returns None if all edges of these vertices were tried.
        """
        untried = np.bincount(self.unexplored[:, 0], minlength=len(self)) * self.reachable(start)
        total = int(untried.sum())
        return int(rng.choice(len(self), p=untried / total)) if total else None

    def observe(self, state: int, action: int, arrived: int) -> None:
        """Record the end of a motion along the edge `action` of vertex `state`.

        `arrived`: the goal of the edge if the motion reached it, otherwise another vertex, for example `state`. The try counts as a success
        if `arrived` is the goal of the edge, else as a failure.
        """
        goal = self.space.goal(state, action)
        self.beliefs.observe(state, action, arrived == goal)
        back = self.action(goal, state) if self.both_ways else None
        if back is not None:
            self.beliefs.observe(goal, back, arrived == goal)

    def action(self, state: int, goal: int) -> int | None:
        """Return the action (column of `space.goals`) whose edge leads from vertex `state` to vertex `goal`; None if no edge does."""
        found = np.flatnonzero(self.space.actions(state) == goal)
        return int(found[0]) if len(found) else None

    def grow(self, samples: ArrayLike, neighbours: int = NEIGHBOURS) -> Ints:
        """Add `samples`, poses of the d joints (N, d) rad, as vertices; return the indices of the new vertices, (N,).

        Each new vertex gets edges to and from its `neighbours` nearest vertices, at least 1. For this distance, each joint's difference is
        divided by the joint's range. Raises InvalidValue for samples beyond the joints' limits.
        """
        neighbours, new = checked_count("neighbours", neighbours, 1), self._new(samples)
        poses, old = np.concatenate([self.space.samples, new]), len(self)
        spans = np.ptp(self.space.robot.limits[[self.space.robot.motor_index(joint) for joint in self.space.joints]], axis=1)
        edges = []
        for vertex in range(old, len(poses)):
            away = np.linalg.norm((poses - poses[vertex]) / spans, axis=1)
            away[vertex] = np.inf
            for near in np.argsort(away, kind="stable")[: min(neighbours, len(poses) - 1)].tolist():
                edges += [(vertex, near), (near, vertex)]
        self._change(poses, [*edges_of(self.space.goals), *edges], np.arange(old))
        return np.arange(old, len(poses))

    def join(self, state: int, samples: ArrayLike, goal: int) -> Ints:
        """Add a path in both directions between the vertices `state` and `goal`, through `samples`, K >= 1 new poses (K, d) rad.

        Returns the indices of the new vertices, (K,). The method is meant for a vertex without usable edges, from which a single-query
        planner has found a path.
        """
        first, last = (int(target_states(self.space, vertex)[0]) for vertex in (state, goal))
        new, old = self._new(samples), len(self)
        chain = [first, *range(old, old + len(new)), last]
        edges = [pair for one, other in zip(chain, chain[1:], strict=False) for pair in ((one, other), (other, one))]
        self._change(np.concatenate([self.space.samples, new]), [*edges_of(self.space.goals), *edges], np.arange(old))
        return np.arange(old, old + len(new))

    def prune(self, start: int) -> Ints:
        """Remove the vertices that cannot be reached from vertex `start`; return the new number of every vertex, (S,), -1 for removed ones.

        If `mode` of the roadmap is "remove", failed edges of the remaining vertices are removed too. A vertex always keeps at least one
        edge: if all its edges failed, these remain; if all its edges led to removed vertices, it gets a new edge to the nearest vertex.
        Raises MobeeError if no other vertex can be reached from `start`.
        """
        kept = np.flatnonzero(self.reachable(start))
        if len(kept) < 2:
            raise MobeeError(f"from vertex {start} no other can be reached: repair it first, or prune from another one.")
        number = np.full(len(self), -1)
        number[kept] = np.arange(len(kept))
        dead = self.beliefs.mode == "remove"
        edges: Edges = []
        for state in kept.tolist():
            row = [(state, goal) for goal in self.space.actions(state).tolist() if number[goal] >= 0]
            sound = [edge for edge, works in zip(row, self._works(row), strict=True) if works] if dead else row
            edges += sound or row or [(state, self._nearest(state, kept))]
        self._change(self.space.samples[kept], [(int(number[s]), int(number[g])) for s, g in edges], number)
        return number

    def _search(self, goals: ArrayLike) -> tuple[Array, Ints]:
        """Return the cost of the cheapest path from each vertex to one of the vertices `goals`, and the next vertex on this path, (S,)."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        edges = self._edge_costs()
        states, actions = np.nonzero(np.isfinite(edges))
        reverse = (self.space.goals[states, actions], states)
        graph = csr_array((edges[states, actions], reverse), shape=(len(self), len(self)))
        costs, following, _ = dijkstra(graph, indices=target_states(self.space, goals), min_only=True, return_predecessors=True)
        return costs, following

    def _works(self, edges: Edges) -> list[bool]:
        found = (self.action(state, goal) for state, goal in edges)
        return [action is not None and bool(self.beliefs.last[state, action]) for (state, _), action in zip(edges, found, strict=True)]

    def _nearest(self, state: int, others: Ints) -> int:
        away = np.linalg.norm(self.space.samples[others] - self.space.samples[state], axis=1)
        return int(others[np.where(others == state, np.inf, away).argmin()])

    def _new(self, samples: ArrayLike) -> Array:
        new = np.atleast_2d(real_array("samples", samples))
        if new.ndim != 2 or new.shape[1] != len(self.space.joints) or not len(new) or not np.isfinite(new).all():
            joints = ", ".join(self.space.joints)
            raise InvalidValue(f"samples have shape {np.shape(samples)}: give at least one finite pose of {joints}, shape (N, d), in rad.")
        low, high = self.space.robot.limits[[self.space.robot.motor_index(joint) for joint in self.space.joints]].T
        beyond = np.maximum(low - new, new - high)
        if beyond.max() > BEYOND:
            row, column = np.unravel_index(beyond.argmax(), beyond.shape)
            raise InvalidValue(
                f"sample {row} has {self.space.joints[column]} at {new[row, column]:.4g}: valid is {low[column]:.4g} to {high[column]:.4g}."
            )
        return new

    def _change(self, samples: Array, edges: Edges, number: Ints) -> None:
        """Replace the graph; `number` (S,) are the new numbers of the vertices; beliefs about remaining edges are kept."""
        before, old = self.beliefs, self.space
        goals = table_of(joined(edges), len(samples))
        self.space = Space(old.robot, old.joints, samples, goals, old.rest)
        states, actions, rows, columns = [], [], [], []
        for state, action in np.argwhere(old.goals != NO_ACTION).tolist():
            now, goal = int(number[state]), int(number[old.goals[state, action]])
            here = self.action(now, goal) if now >= 0 and goal >= 0 else None
            if here is not None:
                states.append(now)
                actions.append(here)
                rows.append(state)
                columns.append(action)
        self.beliefs = before.moved(self.space.goals, np.array(states), np.array(actions), (np.array(rows), np.array(columns)))

    def _edge_costs(self) -> Array:
        """Return length / probability of the edges, shape (S, A), infinite for removed ones and where there is no edge."""
        p, lengths = self.beliefs.success, self.lengths
        costs: Array = np.divide(lengths, p, out=np.full(p.shape, np.inf), where=p > 0.0)
        return costs


class EdgeBeliefs:
    """Beliefs about the outcomes of edges: an edge ends at its goal with probability p, or else at the vertex where it began.

    The class has the interface of `mobee.learning.value_iteration.OutcomeModel`, so planners can use it.

    Args:
        goals: (S, A) goal vertex of each edge; row: vertex where the edge begins (S vertices), column: number of the edge there (at most
            A edges); NO_ACTION (-1) where there is no edge.
        mode: "remove": a failed edge is excluded (p = 0) until it succeeds; all other edges have p = 1 (thesis). "reweigh": p is the mean
            of a Beta distribution over weighted counts of successes and failures.
        forgetting: factor on all counts at each observation of any edge, in (0, 1], so that old failures are forgotten; no effect with
            "remove".
    """

    def __init__(self, goals: Ints, mode: Mode = "remove", forgetting: float = 1.0) -> None:
        if mode not in MODES:
            raise UnknownName("mode", mode, MODES)
        if not 0.0 < forgetting <= 1.0:
            raise InvalidValue(f"forgetting={forgetting!r}: valid is a factor above 0 and at most 1.")
        self.mode: Mode = mode
        self.forgetting = forgetting
        self.goals = goals
        self.worked: Array = np.zeros(goals.shape)
        """Weighted number of successes of each edge, shape (S, A)."""
        self.failed: Array = np.zeros(goals.shape)
        """Weighted number of failures of each edge, shape (S, A)."""
        self.tried: Ints = np.zeros(goals.shape, dtype=np.intp)
        """Number of observations of each edge, shape (S, A)."""
        self.last: NDArray[np.bool_] = goals != NO_ACTION
        """Whether each edge ended at its goal when it was last observed, shape (S, A); True for edges that were never observed."""

    @property
    def success(self) -> Array:
        """The probability that an edge ends at its goal, shape (S, A), 0 where there is no edge."""
        if self.mode == "remove":
            return np.where(self.last, 1.0, 0.0)
        worked, failed = PRIOR
        p: Array = (worked + self.worked) / (worked + failed + self.worked + self.failed)
        return np.where(self.goals == NO_ACTION, 0.0, p)

    @property
    def outcomes(self) -> Ints:
        """The two possible end vertices of each edge, shape (S, A, 2): its goal, and the vertex where it began."""
        began = np.broadcast_to(np.arange(len(self.goals))[:, None], self.goals.shape)
        return np.stack([np.where(self.goals == NO_ACTION, began, self.goals), began], axis=-1)

    @property
    def probabilities(self) -> Array:
        """Probabilities of the two ends of each edge, (S, A, 2): its goal, and the vertex where it began; 0 where there is no edge."""
        p = self.success
        return np.stack([p, np.where(self.goals == NO_ACTION, 0.0, 1.0 - p)], axis=-1)

    def observe(self, state: int, action: int, arrived: bool) -> None:
        """Count a try of the edge `action` of vertex `state`; `arrived`: whether the motion ended at the goal of the edge."""
        if self.forgetting < 1.0:
            self.worked *= self.forgetting
            self.failed *= self.forgetting
        counts = self.worked if arrived else self.failed
        counts[state, action] += 1.0
        self.tried[state, action] += 1
        self.last[state, action] = arrived

    def moved(self, goals: Ints, states: Ints, actions: Ints, before: tuple[Ints, Ints]) -> EdgeBeliefs:
        """Return a copy of these beliefs for a changed graph with the table `goals` (S', A').

        `states`, `actions` (E,): rows and columns in the new table of the E edges that are in both tables. `before`: (rows, columns) of the
        same edges in the old table. All other edges of the new table start without observations.
        """
        found = EdgeBeliefs(goals, self.mode, self.forgetting)
        for name in ("worked", "failed", "tried", "last"):
            getattr(found, name)[states, actions] = getattr(self, name)[before]
        return found


def roadmap_space(roadmap: Roadmap, joints: Sequence[str] | None = None) -> Space:
    """Return a space whose states are a roadmap's poses and whose actions are its edges, in both directions.

    States are the vertices of the map's largest connected component, in their order; all other vertices are left out. Vertices that have
    the same positions of `joints` become one state. The part's motors that are not in `joints` do not move: they keep the
    positions that they have in the first vertex of this component.

    Args:
        roadmap: e.g. of `mobee.build_roadmap`.
        joints: names of motors of one part of the robot; None: the motors that may move in the map.

    Raises:
        InvalidValue, UnknownName: the joints belong to several parts, a name is unknown, or no edge joins two different states.
    """
    robot = roadmap.model.robot
    names = tuple(roadmap.motors if joints is None else joints)
    moving = {robot.motor_table[robot.motor_index(name)].part for name in names}
    if joints is None and len(moving) > 1:
        raise InvalidValue(
            f"the map moved {', '.join(sorted(moving))}, an agent has one part: give joints=[...] of one, "
            "or build a map with its motors only."
        )
    part, columns = checked_joints(robot, names)
    kept = np.flatnonzero(roadmap.graph.components == 0)
    _, first, number = np.unique(np.round(roadmap.q[np.ix_(kept, columns)], DECIMALS), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first, kind="stable")
    rank = np.empty(len(order), dtype=np.intp)
    rank[order] = np.arange(len(order))
    states = np.full(len(roadmap.q), -1)
    states[kept] = rank[number.ravel()]
    ends = states[roadmap.edges]
    ends = ends[(ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1])]
    if not len(ends):
        raise InvalidValue("the map has no edge between two poses of these joints: build it with more neighbours, or a larger `longest`.")
    edges = joined([(int(s), int(g)) for s, g in np.concatenate([ends, ends[:, ::-1]])])
    low, high = robot.limits[part.slice].T
    rest = np.clip((roadmap.q[kept[0], part.slice] - low) / np.where(high > low, high - low, 1.0), 0.0, 1.0)
    return Space(robot, names, roadmap.q[np.ix_(kept[first[order]], columns)], table_of(edges, len(order)), rest.tolist())
