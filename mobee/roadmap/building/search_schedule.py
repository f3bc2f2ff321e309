"""Schedules the evolution-strategy searches of a growing roadmap: start vertex, target, time-out (thesis Algorithm 4)."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.roadmap.building.chart import NEAREST, Chart, Flags, Rows, inside
from mobee.roadmap.building.front import Front
from mobee.roadmap.evolution.search import Searches

APART = 2.0 * NEAREST  # spacings between what two searches aim at
ALIKE = 0.5  # spacings: aims nearer than this are one for the count of failures
FIRST_AT_ONCE, FIRST_MOST = 4, 60  # searches for the first pose
FIRST_PATIENCE = 30  # generations a motor, where nothing is known of how long a search takes
RECENT, ENOUGH = 200, 8  # successes that tell
LEAST = 100  # generations over the dimensions of the task space, that a search has at least
WIDER = 4  # times as many for one after another has failed there
MOVE, NARROW = 0.5, 0.003  # a standard deviation: this share of the move that is predicted; and the least one, in ranges
STALLED = 1e-4  # of the ranges: a search that is as narrow has failed
NEAR = {1: 16, 2: 48, 3: 96}  # vertices that a search knows of, in so many dimensions; in more of them, 192
IDLE, FIRST = -1, -2  # instead of a vertex that a search began at


class SearchSchedule:
    """The searches that go on, L at once.

    `vertex` (L,): where each began, IDLE, or FIRST for the first pose.  `aim` (L, m): what it aims at, in spacings; NaN: at nothing.
    `near` (L, K, m): the vertices next to that, infinite where there are fewer.
    """

    def __init__(self, chart: Chart, postures: Rows, start: Array, how: Front, population: int, rng: np.random.Generator) -> None:
        self._chart, self._postures, self._start, self._how, self._rng = chart, postures, start, how, rng
        count, m = how.searches, chart.dimensions
        self.searches = Searches(count, len(start), population)
        self.vertex = np.full(count, IDLE)
        self.aim = np.full((count, m), np.nan)
        self.near = np.full((count, NEAR.get(m, 192), m), np.inf)
        self._patience = np.zeros(count, dtype=np.int64)
        self._failed = Rows((m,))
        self._ages = Rows((), np.int64)  # generations that searches took which succeeded
        self._begun = 0

    @property
    def exhausted(self) -> bool:
        """Whether no first pose was found, and none is sought any longer."""
        return not len(self._chart) and self._begun >= FIRST_MOST and not (self.vertex == FIRST).any()

    def may_grow(self) -> Flags:
        """Which vertices may still be searched from, (V,)."""
        able: Flags = self._chart.weights > 0.0
        return able & self._chart.free.any(axis=1) if self._how.frontier else able

    def refill(self) -> None:
        """Begin searches where there is room for them: heaviest vertex first, of equal ones the oldest."""
        room = np.flatnonzero(self.vertex == IDLE).tolist()
        if not len(self._chart):
            self._refill_first(room)
            return
        if not room:
            return
        able = np.flatnonzero(self.may_grow())
        busy = [self._centre(number) for number in np.flatnonzero(self.vertex != IDLE).tolist()]
        for vertex in able[np.argsort(-self._chart.weights[able], kind="stable")].tolist():
            if not room:
                return
            places = self._places_to_go(vertex)
            if busy:
                places = places[((places[:, None] - np.array(busy)) ** 2).sum(axis=-1).min(axis=1) >= APART**2]
            if len(places) and self._begin(room[0], vertex, places):
                busy.append(self._centre(room.pop(0)))

    def found(self, number: int, place: Array, simplex: Array | None) -> None:
        """A search has ended with a vertex there (m,) and its simplex; so do those that are pointless now, by no fault of theirs."""
        if self.vertex[number] >= 0:
            self._ages.append(self.searches.age[number])
        self.vertex[number] = IDLE
        self.vertex[self.vertex == FIRST] = IDLE
        going = np.flatnonzero(self.vertex >= 0)
        if not len(going):
            return
        if self._how.frontier:
            taken = ((self.aim[going] - place) ** 2).sum(axis=1) < NEAREST**2
            if simplex is not None:
                taken |= inside(self.aim[going], place, simplex)
            self.vertex[going[taken]] = IDLE
        self._know(going, place)

    def give_up(self) -> None:
        """End the searches that have failed, and lower the weights of where they began."""
        over = (self.vertex != IDLE) & ((self.searches.age >= self._patience) | (self.searches.sigma < STALLED))
        for number in np.flatnonzero(over & (self.vertex >= 0)):
            self._chart.weights[self.vertex[number]] -= self._how.delta
            self._failed.append(self.aim[number])
        self.vertex[over] = IDLE

    def state(self) -> dict[str, NDArray[Any]]:
        """All that `restore` needs, but for the chart, its postures and the generator."""
        lanes = {name: getattr(self.searches, name) for name in ("mean", "sigma", "shape", "path", "age")}
        own = {"vertex": self.vertex, "aim": self.aim, "patience": self._patience, "begun": np.array(self._begun)}
        return lanes | own | {"failed": self._failed.all, "ages": self._ages.all}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on where `state` was taken, with the chart as it was."""
        for rows, name in ((self._failed, "failed"), (self._ages, "ages")):
            for row in state[name]:
                rows.append(row)
        for name in ("mean", "sigma", "shape", "path", "age"):
            getattr(self.searches, name)[:] = state[name]
        self.vertex[:], self.aim[:], self._patience[:] = state["vertex"], state["aim"], state["patience"]
        self._begun = int(state["begun"])
        for number in np.flatnonzero(self.vertex >= 0).tolist():
            self._look_around(number)

    def _refill_first(self, room: list[int]) -> None:
        """Search for a first pose, in turn from the start and from anywhere."""
        going = int((self.vertex == FIRST).sum())
        for number in room[: max(0, min(FIRST_AT_ONCE - going, FIRST_MOST - self._begun))]:
            mean = self._start if self._begun % 2 == 0 else self._rng.uniform(size=len(self._start))
            self._begun += 1
            self.searches.begin(number, mean, self._how.wide_std)
            self.vertex[number], self._patience[number] = FIRST, FIRST_PATIENCE * len(self._start)

    def _places_to_go(self, vertex: int) -> Array:
        """What a search from a vertex may aim at, (k, m); without aims, the vertex's own place."""
        here = self._chart.places[vertex]
        around: Array = here + self._chart.ways[self._chart.free[vertex]] if self._how.frontier else here[None]
        return around

    def _begin(self, number: int, vertex: int, places: Array) -> bool:
        """Begin a search from a vertex to one of the places (k, m), with the fewest failures about it; False: all out of reach."""
        mean, std, patience = self._postures.all[vertex], self._how.std, self._patient()
        if self._how.frontier:
            failed = (((places[:, None] - self._failed.all) ** 2).sum(axis=-1) < ALIKE**2).sum(axis=1)
            if failed.min() >= self._how.tries:
                self._chart.weights[vertex] = 0.0
                return False
            places = places[failed == failed.min()]
            self.aim[number] = places[self._rng.integers(len(places))]
            if failed.min() > 0:
                std, patience = self._how.wide_std, WIDER * patience
            elif self._how.predict:
                mean = predicted(self._chart, self._postures.all, vertex, self.aim[number])
                std = min(max(MOVE * float(np.sqrt(((mean - self._postures.all[vertex]) ** 2).mean())), NARROW), std)
        self.vertex[number], self._patience[number] = vertex, patience
        self.searches.begin(number, mean, std)
        self._look_around(number)
        return True

    def _patient(self) -> int:
        """Generations after which a search has failed, by what those took that did not."""
        ages = self._ages.all[-RECENT:]
        if len(ages) < ENOUGH:
            return FIRST_PATIENCE * len(self._start)
        return max(LEAST // self._chart.dimensions, int(self._how.patience * np.sort(ages)[3 * len(ages) // 4]))

    def _centre(self, number: int) -> Array:
        """Where a search may be expected to end, or where it began."""
        place: Array = self.aim[number] if self._how.frontier else self._chart.places[self.vertex[number]]
        return place

    def _look_around(self, number: int) -> None:
        """Tell a search the vertices that are near."""
        near, _ = self._chart.nearest(self._centre(number), self.near.shape[1])
        self.near[number] = np.inf
        self.near[number, : len(near)] = self._chart.places[near]

    def _know(self, going: Ints, place: Array) -> None:
        """Tell searches of a new vertex, which takes the place of the furthest that they know of, if it is nearer."""
        centres = self.aim[going] if self._how.frontier else self._chart.places[self.vertex[going]]
        apart = ((self.near[going] - centres[:, None]) ** 2).sum(axis=-1)
        furthest = apart.argmax(axis=1)
        nearer = ((place - centres) ** 2).sum(axis=1) < apart[np.arange(len(going)), furthest]
        self.near[going[nearer], furthest[nearer]] = place


_NEAR = 2.5  # spacings
_SAME = 0.2  # of a motor's range: postures further apart are not of one kind
_DAMPING = 0.1  # spacings squared


def predicted(chart: Chart, postures: Array, vertex: int, aim: Array) -> Array:
    """A posture (d,) in [0, 1] for a place (m,), by a linear fit to the postures (V, d) of the vertex and of its like about it."""
    near, apart = chart.nearest(chart.places[vertex], 6 * chart.dimensions + 1)
    near = near[apart < _NEAR]
    near = near[(np.abs(postures[near] - postures[vertex]) < _SAME).all(axis=1)]
    middle, centre = postures[near].mean(axis=0), chart.places[near].mean(axis=0)
    ways = chart.places[near] - centre
    slope = np.linalg.solve(ways.T @ ways + _DAMPING * np.eye(len(aim)), ways.T @ (postures[near] - middle))
    found: Array = np.minimum(np.maximum(middle + (aim - centre) @ slope, 0.0), 1.0)
    return found
