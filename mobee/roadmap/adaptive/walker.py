# SPDX-License-Identifier: Apache-2.0
"""Moves a robot along an adaptive roadmap: a walker follows paths and replans, an explorer tries edges (thesis 4.2, 4.3).

Both observe which edges are free; edges that were never tried count as free.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, MobeeError
from mobee.learning.explorers import Draws
from mobee.learning.goal import target_states
from mobee.plant import Outcome, Plant
from mobee.roadmap.adaptive.adaptive import AdaptiveRoadmap
from mobee.roadmap.adaptive.record import MapRecord, MapStore

NEAR = 0.15  # rad: the part is at a vertex if the distance of every joint from the vertex is at most this
DOORS = 5  # number of nearest vertices that are tried if the part is off the map
TRAIL = 50  # number of vertices visited last that are tried first
MAX_QUERIES = 3  # single queries for a path to one vertex

Query = Callable[[Array, Array], Array | None]


@dataclass(frozen=True, slots=True)
class Walk:
    """The result of a walk.

    `arrived`: whether it ended in a goal. `edges`: number of edges tried. `bumps`: number of edges that failed.
    """

    arrived: bool
    edges: int
    bumps: int


class Walker:
    """Moves one part of a robot along the edges of an adaptive roadmap.

    To move along an edge, the walker commands the part to the pose of the edge's goal. The edge succeeds if the part comes to rest within
    `near` of the goal. Otherwise the map records the failure, the part moves back to the start of the edge (in thesis 4.1 by the reflex,
    which retraces the recent poses after a contact), and the walker plans a new path.

    Args:
        roadmap: the map, which the walker changes.
        plant: executes the actions; its robot must be that of the map.
        near: largest distance of every joint from a vertex at which the part counts as being there [rad].
        back: True: the part moves back after each failure.  False: `go` moves it directly to the next vertex of the new path; it moves back
            only if it does not arrive at this vertex.
        store: receives the observations; if it already has some, the walker continues from them.

    Raises:
        InvalidValue: the plant has another robot.
        MobeeError: the store belongs to another map.
    """

    def __init__(
        self, roadmap: AdaptiveRoadmap, plant: Plant, near: float = NEAR, back: bool = True, store: MapStore | None = None
    ) -> None:
        if plant.robot.motors != roadmap.space.robot.motors:
            raise InvalidValue(
                f"the plant moves {plant.robot.name!r}, the map is of {roadmap.space.robot.name!r}: make both from one robot."
            )
        self.roadmap, self.plant, self.part = roadmap, plant, roadmap.space.part
        self.near, self.back = near, back
        self.here: int | None = None
        """The vertex where the part is; None if the part is at no vertex, or if its position is not known."""
        self._trail: list[int] = []  # the vertices visited, the last one at the end
        self.record = MapRecord(roadmap, store, self.settings)
        """The record of observations and changes; change the map only by `record.change`."""
        self.record.on_renumbered = self._renumber

    @property
    def settings(self) -> dict[str, Any]:
        """The constructor's arguments `near` and `back`, and the settings of the roadmap, as plain JSON values."""
        return {"roadmap": self.roadmap.settings, "near": self.near, "back": self.back}

    def go(self, goals: ArrayLike, most: int | None = None) -> Walk:
        """Move to one of the vertices `goals` over at most `most` edges (None: no limit); plan a new path after each failed edge.

        Raises MobeeError if there is no path, and ActionInterrupted if the plant interrupts an action.
        """
        targets = set(target_states(self.roadmap.space, goals).tolist())
        edges, bumps = 0, 0
        here = self.enter()
        while here not in targets:
            if most is not None and edges >= most:
                return Walk(False, edges, bumps)
            worked = self.follow(here, self.roadmap.plan(here, goals)[1])
            edges, bumps = edges + 1, bumps + (not worked)
            here = self.enter() if worked or self.back else self._onward(here, goals)
        return Walk(True, edges, bumps)

    def follow(self, state: int, goal: int) -> bool:
        """Move along the edge from vertex `state` to vertex `goal` and record the outcome; return whether the motion succeeded.

        After a failure the robot's part moves back to `state` if the constructor's argument `back` is True. Raises InvalidValue if the
        roadmap has no such edge, and ActionInterrupted if the plant interrupts an action.
        """
        action = self.roadmap.action(state, goal)
        if action is None:
            raise InvalidValue(f"the map has no edge from {state} to {goal}: valid are {self.roadmap.space.actions(state).tolist()}.")
        outcome = self._move(goal)
        worked = self._is_at(outcome.q, goal)
        self.record.observe(state, action, goal if worked else state, outcome)
        self._trail = [*self._trail[-TRAIL:], state]
        if worked:
            self.here = goal
        elif self.back and self._comes_to(state):
            self.here = state
        return worked

    def enter(self) -> int:
        """Return the vertex where the part is; if the part is at no vertex, move it to one.

        The part then tries the vertices that it visited last, the latest first, and after them the five nearest vertices, until it arrives
        at one. Raises MobeeError if it arrives at none.
        """
        if self.here is None:
            q = self.plant.measure(self.part)
            near = self._nearest(q)
            self.here = near[0] if self._is_at(q, near[0]) else self._door(near)
        return self.here

    def _door(self, near: list[int]) -> int:
        trail, self._trail = self._trail, []
        for last in range(len(trail) - 1, -1, -1):
            if trail[last] < len(self.roadmap) and trail[last] not in trail[last + 1 :] and self._comes_to(trail[last]):
                self._trail = trail[:last]
                return trail[last]
        for vertex in near[:DOORS]:
            if self._comes_to(vertex):
                return vertex
        raise MobeeError(f"{self.part} is off the map, and reaches none of the vertices {near[:DOORS]}: add samples near it.")

    def _comes_to(self, vertex: int) -> bool:
        return self._is_at(self._move(vertex).q, vertex)

    def _onward(self, state: int, goals: ArrayLike) -> int:
        """Move to the next vertex of the new path without moving back first; move back if that fails."""
        path = self.roadmap.plan(state, goals)
        for vertex in (path[1], state):
            if self._comes_to(vertex):
                self.here = vertex
                break
        return self.enter()

    def _renumber(self, number: Ints) -> None:
        """Replace the kept numbers of vertices by their new ones, and forget removed vertices; `number` (S,): new numbers, -1: removed."""
        if self.here is not None:
            self.here = int(number[self.here]) if number[self.here] >= 0 else None
        self._trail = [int(number[vertex]) for vertex in self._trail if number[vertex] >= 0]

    def _move(self, vertex: int) -> Outcome:
        self.here = None  # until the action has ended
        return self.plant.act(self.part, self.roadmap.space.target(vertex))

    def _is_at(self, q: Array, vertex: int) -> bool:
        space = self.roadmap.space
        return bool(np.abs(q[space.columns] - space.samples[vertex]).max() <= self.near)

    def _nearest(self, q: Array) -> list[int]:
        """Return the numbers of all vertices, the nearest to q (n,) rad first, by the largest distance of a joint."""
        space = self.roadmap.space
        away = np.abs(space.samples - q[space.columns]).max(axis=1)
        return [int(vertex) for vertex in np.argsort(away, kind="stable")]


class MapExplorer(Walker):
    """Moves one part of a robot to untried edges of an adaptive roadmap until all reachable edges were tried; a subclass of `Walker`.

    A vertex may have feasible edges that lead to it and none that leave it. At such a vertex the explorer queries a path to a vertex with
    untried edges, and adds this path to the map. A new explorer with the same store continues where the last one stopped.

    Args:
        roadmap: the map, which the explorer changes.
        plant: executes the actions; its robot must be that of the map.
        near: largest distance of every joint from a vertex at which the part counts as being there [rad].
        seed: of the random choices.
        query: finds a path where the map has none. Arguments: a pose of the joints (d,) and several goal poses (G, d), rad. Result: poses
            (K, d) from the start to one of the goals, or None; `mobee.roadmap.ompl.query` makes such a function. None: the explorer stops
            at a vertex that no usable edge leaves.
        store: receives the observations and the changes of the map; if it already has some, the explorer continues from them.
    """

    def __init__(
        self,
        roadmap: AdaptiveRoadmap,
        plant: Plant,
        near: float = NEAR,
        seed: int = 0,
        query: Query | None = None,
        store: MapStore | None = None,
    ) -> None:
        self.seed = seed
        super().__init__(roadmap, plant, near, True, store)
        self.repairs = 0
        """Number of paths that the query has found and that were joined to the map."""
        self._query, self._draws = query, Draws(f"map of {self.part}")
        self._asked_for: Counter[int] = Counter()
        self._target: int | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the base class `Walker` and the seed, as plain JSON values."""
        return super().settings | {"seed": self.seed}

    def explore(self, edges: int | None = None) -> bool:
        """Try at most `edges` edges (None: no limit); return whether all reachable edges were tried.

        Raises ActionInterrupted if the plant interrupts an action.
        """
        done = 0
        while edges is None or done < edges:
            here = self.enter()
            goal = self._choice(here)
            if goal is not None:
                self.follow(here, goal)
                done += 1
            elif not self._escape(here):
                return True
        return False

    def _choice(self, here: int) -> int | None:
        """Return the next goal: along an untried edge of this vertex, or towards a vertex with untried edges; None: none is left."""
        draws, roadmap = self._draws.at(self.seed, self.record.transitions), self.roadmap
        untried = roadmap.unexplored
        if self._target is None or self._target == here or not self._is_worth_it(here):
            self._target = here if (untried[:, 0] == here).any() else roadmap.next_target(here, draws)
        if self._target is None:
            return None
        if self._target == here:
            return roadmap.space.goal(here, int(draws.choice(untried[untried[:, 0] == here, 1])))
        return roadmap.plan(here, self._target)[1]

    def _is_worth_it(self, here: int) -> bool:
        return bool(self.roadmap.reachable(here)[self._target]) and bool((self.roadmap.unexplored[:, 0] == self._target).any())

    def _escape(self, here: int) -> bool:
        """Join this vertex to vertices with untried edges, by the query; return whether it found a path."""
        left = sorted({*self.roadmap.unexplored[:, 0].tolist()} - self.record.joined - {here})
        others = [vertex for vertex in left if self._asked_for[vertex] < MAX_QUERIES]
        if self._query is None or not others:
            return False
        space = self.roadmap.space
        path = self._query(self.plant.measure(self.part)[space.columns], space.samples[others])
        if path is None:
            self._asked_for.update(MAX_QUERIES * others)
            return False
        goal = others[int(np.abs(space.samples[others] - path[-1]).max(axis=1).argmin())]
        self._asked_for[goal] += 1
        between = path[1:-1] if len(path) > 2 else 0.5 * (path[:1] + path[-1:])
        self.record.change("join", state=here, samples=between.tolist(), goal=goal)
        self.repairs += 1
        return True

    def _renumber(self, number: Ints) -> None:
        super()._renumber(number)
        self._asked_for = Counter({int(number[vertex]): count for vertex, count in self._asked_for.items() if number[vertex] >= 0})
        if self._target is not None:
            self._target = int(number[self._target]) if number[self._target] >= 0 else None

    def _door(self, near: list[int]) -> int:
        try:
            return super()._door(near)
        except MobeeError:
            if self._query is None:
                raise
        space = self.roadmap.space
        path = self._query(self.plant.measure(self.part)[space.columns], space.samples[near])
        for pose in () if path is None else path[1:]:
            target = space.target(near[0])
            target[space.columns] = pose
            q = self.plant.act(self.part, target).q
            nearest = self._nearest(q)
            if self._is_at(q, nearest[0]):
                return nearest[0]
        return super()._door(self._nearest(self.plant.measure(self.part)))
