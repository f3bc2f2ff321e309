# SPDX-License-Identifier: Apache-2.0
"""Explores which edges of an adaptive roadmap are free; edges that were never tried count as free (thesis 4.3.1)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import MobeeError
from mobee.learning.explorers import Draws
from mobee.plant import Plant
from mobee.roadmap.adaptive.adaptive import AdaptiveRoadmap
from mobee.roadmap.adaptive.record import MapStore
from mobee.roadmap.adaptive.walker import NEAR, Walker

MAX_QUERIES = 3  # single queries for a path to one vertex

Query = Callable[[Array, Array], Array | None]


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
