# SPDX-License-Identifier: Apache-2.0
"""Schedules the searches by evolution strategy for new vertices of a roadmap, with their settings (thesis Algorithm 4).

A search has a start, an aim and a time limit.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.roadmap.building.frontier import MIN_DISTANCE, Flags, Frontier, GrowingArray, inside_simplex
from mobee.roadmap.evolution.search import Searches

AIM_DISTANCE = 2.0 * MIN_DISTANCE  # spacings between the aims of two simultaneous searches, at least
FAILURE_RADIUS = 0.5  # spacings: failures nearer to an aim than this count for it
FIRST_SEARCHES, MAX_FIRST_SEARCHES = 4, 60  # searches for the first pose: at once, and in all
FIRST_PATIENCE = 30  # generations per motor, before enough searches have succeeded
RECENT, MIN_SUCCESSES = 200, 8  # successful searches that determine the patience; fewer than the latter do not
MIN_GENERATIONS = 100  # that a search gets, divided by the dimension of the task space
RETRY_FACTOR = 4  # on the patience, after another search has failed at the same point
STD_PER_MOVE, MIN_STD = 0.5, 0.003  # standard deviation: share of the predicted move; and the least one, in ranges of the motors
STALLED_STD = 1e-4  # in ranges of the motors: a search that is narrower has failed
KNOWN_VERTICES = {1: 16, 2: 48, 3: 96}  # number of vertices that a search compares with, by the dimension of the task space
MANY_KNOWN_VERTICES = 192  # in higher dimensions
IDLE, FIRST = -1, -2  # in place of a start vertex

_FIT_RADIUS = 2.5  # spacings
_SAME_BRANCH = 0.2  # of a motor's range: postures that differ by more are not fitted together
_DAMPING = 0.1  # spacings squared


@dataclass(frozen=True, slots=True)
class SearchSettings:
    """Settings of the searches by evolution strategy for the poses (vertices) of a roadmap (thesis Algorithm 4; see docs/roadmaps.md).

    The spacing is the distance between neighbouring vertices in the task space. Raises InvalidValue for a value out of range.

    Attributes:
        delta: decrease of a vertex's expansion weight (1 at first; no search starts from a vertex of weight 0 or less) for each failed
            search that started from the vertex.
        frontier: True: start a search only where a point one spacing away is free, and aim at this point.  False: start from all vertices,
            without an aim, as printed in the thesis.
        predict: True: a search that has an aim begins at a posture extrapolated from the neighbours' postures.  False: at the posture of
            its vertex.
        std: largest standard deviation of a search from a vertex, as a fraction of each motor's range.
        wide_std: standard deviation of a search for the first pose, or where another search has failed, as a fraction of each motor's
            range.
        population: samples per generation; None: 4 + 3 ln(d), rounded down, for d motors that may move.
        patience: factor on the time limit: a search fails after patience * G generations, but not before 100 / m (m: dimension of the task
            space). G: number of generations within which 3/4 of the recent successful searches found their vertex. Until 8 searches have
            succeeded, the limit is 30 d generations. It is 4 times as long for an aim within half a spacing of the aim of a failed search.
        tries: largest number of failed searches around a point.  After so many failed searches with aims within half a spacing of a point,
            no further search aims at this point.
        searches: number of simultaneous searches.
    """

    delta: float = 0.5
    frontier: bool = True
    predict: bool = True
    std: float = 0.02
    wide_std: float = 0.2
    population: int | None = None
    patience: float = 3.0
    tries: int = 3
    searches: int = 32

    def __post_init__(self) -> None:
        check_setting(self, "delta", lambda x: 0.0 < x <= 1.0, "a number above 0 and at most 1")
        for name in ("std", "wide_std"):
            check_setting(self, name, lambda x: 0.0 < x <= 1.0, "a number above 0 and at most 1, in ranges of the motors")
        check_setting(self, "patience", lambda x: x >= 1, "a finite number of at least 1")
        if self.population is not None:
            check_setting(self, "population", lambda x: x >= 4, "a whole number of at least 4, or None", whole=True)
        for name in ("tries", "searches"):
            check_setting(self, name, lambda x: x >= 1, "a whole number of at least 1", whole=True)


def check_setting(settings: object, name: str, fits: Callable[[Any], bool], valid: str, whole: bool = False) -> None:
    """Raise InvalidValue unless a field of a frozen dataclass is a finite number, or a whole one, that `fits`; `valid`: what is valid.

    A number of NumPy is replaced by a plain one, because the settings are written as JSON.
    """
    given = getattr(settings, name)
    if isinstance(given, bool) or not isinstance(given, Integral if whole else Real) or not (np.isfinite(float(given)) and fits(given)):
        raise InvalidValue(f"{name} {given!r}: must be {valid}.")
    if not isinstance(given, int | float):
        object.__setattr__(settings, name, (int if whole else float)(getattr(settings, name)))


class SearchScheduler:
    """Starts and ends searches for new vertices of a roadmap, up to L = `settings.searches` at the same time (thesis Algorithm 4).

    All points are in the task space (dimension m), in spacings: 1 is the distance that neighbouring vertices should have. The attributes
    are arrays with one row for each search. `vertex` (L,): the start vertex; IDLE (-1) where no search runs, FIRST (-2) for a search for
    the first pose. `aim` (L, m): the point at which the search aims; NaN without an aim. `near` (L, K, m): the points of the K vertices
    nearest to the aim, or without an aim to the start vertex; infinite where there are fewer. K is 16, 48 or 96 for m = 1, 2 or 3, else
    192.

    Args:
        frontier: the vertices found so far, as points in the task space, with their expansion weights (searches start at large ones first).
        postures: (V, d) positions of the motors that may move, at the vertices, in fractions of their ranges.
        start: (d,) posture at which the search for the first pose begins, in fractions of the ranges.
        settings: settings of the searches.
        population: number of samples per generation.
        rng: draws the random choices.
    """

    def __init__(
        self,
        frontier: Frontier,
        postures: GrowingArray,
        start: Array,
        settings: SearchSettings,
        population: int,
        rng: np.random.Generator,
    ) -> None:
        self._frontier, self._postures, self._start, self._settings, self._rng = frontier, postures, start, settings, rng
        count, m = settings.searches, frontier.dimensions
        self.searches = Searches(count, len(start), population)
        self.vertex = np.full(count, IDLE)
        self.aim = np.full((count, m), np.nan)
        self.near = np.full((count, KNOWN_VERTICES.get(m, MANY_KNOWN_VERTICES), m), np.inf)
        self._patience = np.zeros(count, dtype=np.int64)
        self._failed = GrowingArray((m,))  # aims of failed searches
        self._ages = GrowingArray((), np.int64)  # generations of successful searches
        self._begun = 0  # searches for the first pose

    @property
    def exhausted(self) -> bool:
        """Whether all searches for the first pose have ended and none has found a pose."""
        return not len(self._frontier) and self._begun >= MAX_FIRST_SEARCHES and not (self.vertex == FIRST).any()

    def expandable(self) -> Flags:
        """Return whether a search may start from each vertex, (V,): its expansion weight must be above 0.

        The weight is 1 at first and is lowered by each failed search that started there. With the setting `frontier` (the default) the
        vertex must also have a free direction: one in which the point one spacing away is not explored yet, as `Frontier` defines it.
        """
        able: Flags = self._frontier.weights > 0.0
        return able & self._frontier.free.any(axis=1) if self._settings.frontier else able

    def refill(self) -> None:
        """Start new searches until `settings.searches` are running, or no vertex is left from which a search may start.

        Vertices with larger expansion weights (1 at first, lowered by each failed search) come first; among equal weights, the vertex that
        was found first. As long as there is no vertex, the searches are those for the first pose, at most 4 at the same time.
        """
        room = np.flatnonzero(self.vertex == IDLE).tolist()
        if not len(self._frontier):
            self._begin_first(room)
            return
        if not room:
            return
        able = np.flatnonzero(self.expandable())
        busy = [self._centre(number) for number in np.flatnonzero(self.vertex != IDLE).tolist()]
        for vertex in able[np.argsort(-self._frontier.weights[able], kind="stable")].tolist():
            if not room:
                return
            points = self._possible_aims(vertex)
            if busy:
                points = points[((points[:, None] - np.array(busy)) ** 2).sum(axis=-1).min(axis=1) >= AIM_DISTANCE**2]
            if len(points) and self._begin(room[0], vertex, points):
                busy.append(self._centre(room.pop(0)))

    def end_successful(self, number: int, point: Array, simplex: Array | None) -> None:
        """End the search `number`, which has found a vertex, and all other searches that are of no use now; these do not count as failed.

        These are all searches for the first pose, and with the setting `frontier` those whose aim is nearer than 0.8 spacings to the new
        vertex, or inside the simplex that this vertex forms with its m nearest vertices. `point`: (m,) of the new vertex, in spacings.
        `simplex`: (m, m), this simplex as `Frontier.add` returns it (inverse of the matrix of its edges), or None.
        """
        if self.vertex[number] >= 0:
            self._ages.append(self.searches.age[number])
        self.vertex[number] = IDLE
        self.vertex[self.vertex == FIRST] = IDLE
        active = np.flatnonzero(self.vertex >= 0)
        if not len(active):
            return
        if self._settings.frontier:
            taken = ((self.aim[active] - point) ** 2).sum(axis=1) < MIN_DISTANCE**2
            if simplex is not None:
                taken |= inside_simplex(self.aim[active], point, simplex)
            self.vertex[active[taken]] = IDLE
        self._note_vertex(active, point)

    def end_failed(self) -> None:
        """End the searches that ran too long or whose distribution is too narrow; lower the expansion weights of their start vertices."""
        over = (self.vertex != IDLE) & ((self.searches.age >= self._patience) | (self.searches.sigma < STALLED_STD))
        for number in np.flatnonzero(over & (self.vertex >= 0)):
            self._frontier.weights[self.vertex[number]] -= self._settings.delta
            self._failed.append(self.aim[number])
        self.vertex[over] = IDLE

    def state(self) -> dict[str, NDArray[Any]]:
        """Return the state of the searches as arrays by name, without the frontier, its postures and the random generator."""
        searches = {name: getattr(self.searches, name) for name in ("mean", "sigma", "shape", "path", "age")}
        own = {"vertex": self.vertex, "aim": self.aim, "patience": self._patience, "begun": np.array(self._begun)}
        return searches | own | {"failed": self._failed.rows, "ages": self._ages.rows}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Continue from `state`, which the method `state` has returned; the frontier must be the same as at that time."""
        for array, name in ((self._failed, "failed"), (self._ages, "ages")):
            for row in state[name]:
                array.append(row)
        for name in ("mean", "sigma", "shape", "path", "age"):
            getattr(self.searches, name)[:] = state[name]
        self.vertex[:], self.aim[:], self._patience[:] = state["vertex"], state["aim"], state["patience"]
        self._begun = int(state["begun"])
        for number in np.flatnonzero(self.vertex >= 0).tolist():
            self._find_near(number)

    def _begin_first(self, room: list[int]) -> None:
        """Start searches for a first pose, alternately at the start posture and at random ones."""
        active = int((self.vertex == FIRST).sum())
        for number in room[: max(0, min(FIRST_SEARCHES - active, MAX_FIRST_SEARCHES - self._begun))]:
            mean = self._start if self._begun % 2 == 0 else self._rng.uniform(size=len(self._start))
            self._begun += 1
            self.searches.begin(number, mean, self._settings.wide_std)
            self.vertex[number], self._patience[number] = FIRST, FIRST_PATIENCE * len(self._start)

    def _possible_aims(self, vertex: int) -> Array:
        """Return the points (k, m), in spacings, that a search from a vertex may try to reach; m: dimension of the task space.

        They lie one spacing from the vertex, in its free directions. Without the setting `frontier` the only point is that of the vertex.
        """
        here = self._frontier.points[vertex]
        around: Array = here + self._frontier.directions[self._frontier.free[vertex]] if self._settings.frontier else here[None]
        return around

    def _begin(self, number: int, vertex: int, points: Array) -> bool:
        """Start a search from a vertex to the point with the fewest failures among `points` (k, m); return False if all were given up."""
        mean, std, patience = self._postures.rows[vertex], self._settings.std, self._usual_patience()
        if self._settings.frontier:
            failed = (((points[:, None] - self._failed.rows) ** 2).sum(axis=-1) < FAILURE_RADIUS**2).sum(axis=1)
            if failed.min() >= self._settings.tries:
                self._frontier.weights[vertex] = 0.0
                return False
            points = points[failed == failed.min()]
            self.aim[number] = points[self._rng.integers(len(points))]
            if failed.min() > 0:
                std, patience = self._settings.wide_std, RETRY_FACTOR * patience
            elif self._settings.predict:
                mean = predicted_posture(self._frontier, self._postures.rows, vertex, self.aim[number])
                move = float(np.sqrt(((mean - self._postures.rows[vertex]) ** 2).mean()))
                std = min(max(STD_PER_MOVE * move, MIN_STD), std)
        self.vertex[number], self._patience[number] = vertex, patience
        self.searches.begin(number, mean, std)
        self._find_near(number)
        return True

    def _usual_patience(self) -> int:
        """Return the number of generations (iterations of NES, the evolution strategy) after which a search counts as failed.

        It is the setting `patience` times the upper quartile of the generations of the last RECENT (200) successful searches, but has a
        lower bound. With fewer than MIN_SUCCESSES (8) of them it is a fixed number times the number of motors.
        """
        ages = self._ages.rows[-RECENT:]
        if len(ages) < MIN_SUCCESSES:
            return FIRST_PATIENCE * len(self._start)
        return max(MIN_GENERATIONS // self._frontier.dimensions, int(self._settings.patience * np.sort(ages)[3 * len(ages) // 4]))

    def _centre(self, number: int) -> Array:
        """Return the aim of a search, or the point of its start vertex."""
        point: Array = self.aim[number] if self._settings.frontier else self._frontier.points[self.vertex[number]]
        return point

    def _find_near(self, number: int) -> None:
        """Set the vertices nearest to the aim of a search."""
        near, _ = self._frontier.nearest(self._centre(number), self.near.shape[1])
        self.near[number] = np.inf
        self.near[number, : len(near)] = self._frontier.points[near]

    def _note_vertex(self, active: Ints, point: Array) -> None:
        """Update the nearest vertices of active searches: a new vertex replaces the furthest of them if the new one is nearer."""
        centres = self.aim[active] if self._settings.frontier else self._frontier.points[self.vertex[active]]
        squares = ((self.near[active] - centres[:, None]) ** 2).sum(axis=-1)
        furthest = squares.argmax(axis=1)
        nearer = ((point - centres) ** 2).sum(axis=1) < squares[np.arange(len(active)), furthest]
        self.near[active[nearer], furthest[nearer]] = point


def predicted_posture(frontier: Frontier, postures: Array, vertex: int, aim: Array) -> Array:
    """Return the predicted posture (d,) for a point `aim` (m,), by a linear fit to the postures of vertices near `vertex`.

    The fit uses only vertices within 2.5 spacings whose postures differ from that of `vertex` by less than 0.2 in every motor.
    Postures (V, d) and the result are in fractions of the motors' ranges, 0 to 1; `aim` is in the task space, in spacings (1 is the
    distance that neighbouring vertices should have).
    """
    near, distances = frontier.nearest(frontier.points[vertex], 6 * frontier.dimensions + 1)
    near = near[distances < _FIT_RADIUS]
    near = near[(np.abs(postures[near] - postures[vertex]) < _SAME_BRANCH).all(axis=1)]
    mean_posture, centre = postures[near].mean(axis=0), frontier.points[near].mean(axis=0)
    offsets = frontier.points[near] - centre
    slope = np.linalg.solve(offsets.T @ offsets + _DAMPING * np.eye(len(aim)), offsets.T @ (postures[near] - mean_posture))
    found: Array = np.minimum(np.maximum(mean_posture + (aim - centre) @ slope, 0.0), 1.0)
    return found
