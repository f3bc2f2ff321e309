# SPDX-License-Identifier: Apache-2.0
"""Adaptive roadmaps: every edge counts as free until a motion along it has failed (thesis 4.2)."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.goal import target_states
from mobee.learning.neighbours import NO_ACTION, Edges, edges_of, joined, table_of
from mobee.learning.space import Space
from mobee.roadmap.adaptive.edge_beliefs import EdgeBeliefs, Mode

NEIGHBOURS = 10  # to which a new sample is joined (thesis 4.3.1)


class AdaptiveRoadmap:
    """A roadmap whose edges are not checked in advance, with the observed outcomes of its edges.

    It is a simple Markov decision process: states are vertices, actions are edges, and an action ends at its goal or
    where it began.  Its graph is a `Space`, its beliefs are an `OutcomeModel`: `mobee.Planner` and
    `mobee.value_iteration` plan on `roadmap.space` and `roadmap.beliefs` as on those of a curious agent.  `plan` finds
    the same paths faster: an edge of length d that succeeds with probability p costs d / p, since it takes 1 / p tries.

    Args:
        space: vertices and edges over joints of one part, e.g. `mobee.Voronoi(robot, joints, 20, neighbours=10)`
            or `mobee.roadmap_space(roadmap)`.
        mode: how a failed edge is treated, "remove" (thesis) or "reweigh"; see `EdgeBeliefs`.
        forgetting: see `EdgeBeliefs`.
        both_ways: whether an observation of an edge also counts for the edge in the opposite direction.

    Raises:
        InvalidValue, UnknownName: an argument is not valid; the message says what is.
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
        """Settings of the map as plain JSON values."""
        beliefs = self.beliefs
        made = {"mode": beliefs.mode, "forgetting": beliefs.forgetting, "both_ways": self.both_ways}
        return made | {"space": self.space.settings}

    @property
    def tried(self) -> int:
        """Number of edges that were tried."""
        return int((self.beliefs.tried > 0).sum())

    @property
    def unexplored(self) -> Ints:
        """The edges that were never tried, as rows of (state, action)."""
        return np.argwhere((self.space.goals != NO_ACTION) & (self.beliefs.tried == 0))

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """Whether each edge ended at its goal when it was last tried, shape (S, A)."""
        return (self.beliefs.tried > 0) & self.beliefs.last

    @property
    def stuck(self) -> Ints:
        """Vertices from which every edge was tried and failed when it was tried last (thesis 4.3.1)."""
        return np.flatnonzero(~self.beliefs.last.any(axis=1))

    @property
    def lengths(self) -> Array:
        """Lengths of the edges in joint space, shape (S, A), rad; 0 where there is no edge."""
        space = self.space
        steps = space.samples[space.goals] - space.samples[:, None]
        return np.where(space.goals == NO_ACTION, 0.0, np.sqrt((steps**2).sum(axis=-1)))

    def plan(self, start: int, goals: ArrayLike) -> tuple[int, ...]:
        """Return the vertices of the cheapest path from a start to one of the goals, both included.

        Raises InvalidValue for a vertex that does not exist, MobeeError if no path is left.
        """
        here = int(target_states(self.space, start)[0])
        targets = set(target_states(self.space, goals).tolist())
        left, edges = self.costs(goals), self._edge_costs()
        if not np.isfinite(left[here]):
            raise MobeeError(
                f"the map has no path from vertex {here} to {sorted(targets)}, because edges that failed were removed. "
                "Grow the map, join its parts by a single query, or change the costs of failed edges instead of removing them."
            )
        path = [here]
        while path[-1] not in targets:
            row = self.space.goals[path[-1]]
            onward = np.where(np.isfinite(edges[path[-1]]), edges[path[-1]] + left[row], np.inf)
            path.append(int(row[onward.argmin()]))
        return tuple(path)

    def costs(self, goals: ArrayLike) -> Array:
        """Return the cost of the cheapest path from each vertex to a goal, shape (S,), infinite where no path is left."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import dijkstra

        edges = self._edge_costs()
        states, actions = np.nonzero(np.isfinite(edges))
        reverse = (self.space.goals[states, actions], states)
        graph = csr_array((edges[states, actions], reverse), shape=(len(self), len(self)))
        found: Array = dijkstra(graph, indices=target_states(self.space, goals), min_only=True)
        return found

    def reward(self, goals: ArrayLike) -> Array:
        """Return the reward (S, A) for which value iteration finds the paths of `plan`: minus the length of each edge.

        It is -inf for edges that are removed, that do not exist, or that begin in a goal.
        """
        left = self.costs(goals)
        usable = np.isfinite(self._edge_costs()) & np.isfinite(left)[self.space.goals] & np.isfinite(left)[:, None]
        usable[target_states(self.space, goals)] = False
        return np.where(usable, -self.lengths, -np.inf)

    def reachable(self, start: int) -> NDArray[np.bool_]:
        """Return whether each vertex can be reached from `start`, (S,); True for `start` itself."""
        from scipy.sparse import csr_array
        from scipy.sparse.csgraph import breadth_first_order

        states, actions = np.nonzero(np.isfinite(self._edge_costs()))
        graph = csr_array((np.ones(len(states)), (states, self.space.goals[states, actions])), shape=(len(self), len(self)))
        found = np.zeros(len(self), dtype=bool)
        found[breadth_first_order(graph, int(target_states(self.space, start)[0]), return_predecessors=False)] = True
        return found

    def next_target(self, start: int, rng: np.random.Generator) -> int | None:
        """Draw a vertex to explore next, in proportion to its untried edges (thesis 4.3.1).

        Returns None if all edges of the reachable vertices were tried.
        """
        untried = np.bincount(self.unexplored[:, 0], minlength=len(self)) * self.reachable(start)
        total = int(untried.sum())
        return int(rng.choice(len(self), p=untried / total)) if total else None

    def observe(self, state: int, action: int, arrived: int) -> None:
        """Record that a motion along an edge, from vertex `state`, ended at vertex `arrived`: its goal, or another one."""
        goal = self.space.goal(state, action)
        self.beliefs.observe(state, action, arrived == goal)
        back = self.action(goal, state) if self.both_ways else None
        if back is not None:
            self.beliefs.observe(goal, back, arrived == goal)

    def action(self, state: int, goal: int) -> int | None:
        """Return the edge from a vertex to another, None if there is none."""
        found = np.flatnonzero(self.space.actions(state) == goal)
        return int(found[0]) if len(found) else None

    def grow(self, samples: ArrayLike, neighbours: int = NEIGHBOURS) -> Ints:
        """Add poses of the joints (N, d) rad as vertices, with edges to and from the nearest ones; return their numbers."""
        new = self._new(samples)
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
        """Add a path in both directions between two vertices, through K >= 1 new poses of the joints (K, d) rad.

        Returns the numbers of the new vertices.  This repairs a vertex without usable edges by a path that a single-query planner found.
        """
        first, last = (int(target_states(self.space, vertex)[0]) for vertex in (state, goal))
        new, old = self._new(samples), len(self)
        chain = [first, *range(old, old + len(new)), last]
        edges = [pair for one, other in zip(chain, chain[1:], strict=False) for pair in ((one, other), (other, one))]
        self._change(np.concatenate([self.space.samples, new]), [*edges_of(self.space.goals), *edges], np.arange(old))
        return np.arange(old, old + len(new))

    def prune(self, start: int) -> Ints:
        """Remove the vertices that cannot be reached from `start`, and the failed edges of vertices that have other edges.

        A vertex always keeps an edge, if necessary a new one to the nearest vertex.  Returns the new number of every
        vertex, -1 for removed ones, shape (S,).
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

    def _works(self, edges: Edges) -> list[bool]:
        found = (self.action(state, goal) for state, goal in edges)
        return [action is not None and bool(self.beliefs.last[state, action]) for (state, _), action in zip(edges, found, strict=True)]

    def _nearest(self, state: int, others: Ints) -> int:
        away = np.linalg.norm(self.space.samples[others] - self.space.samples[state], axis=1)
        return int(others[np.where(others == state, np.inf, away).argmin()])

    def _new(self, samples: ArrayLike) -> Array:
        new = np.atleast_2d(np.asarray(samples, dtype=np.float64))
        if new.ndim != 2 or new.shape[1] != len(self.space.joints) or not len(new) or not np.isfinite(new).all():
            joints = ", ".join(self.space.joints)
            raise InvalidValue(f"samples have shape {np.shape(samples)}: give at least one finite pose of {joints}, shape (N, d), in rad.")
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
