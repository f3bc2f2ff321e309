"""The advancing front of thesis Algorithms 3 and 4: searches start at vertices and end beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import MobeeError
from mobee.roadmap.building.chart import FIRST, NEAREST, OTHERS, Chart, Flags, Rows
from mobee.roadmap.building.front import Front
from mobee.roadmap.building.judge import Judge
from mobee.roadmap.building.search_schedule import IDLE, SearchSchedule
from mobee.roadmap.evolution.nes import default_population

REPELLED = 0.25  # spacings: what eq. 3.6 counts beside a term at its tolerance
AIMED = 0.5  # spacings: what a free place counts
BEYOND = 1000.0  # of a sample that was moved back into the limits: times its squared way in ranges


class Growth:
    """A map that grows: `step` goes on with every search by a generation and adds what they found.

    `chart`: the vertices in the task space, in spacings.  `rng`: draws all that is random.  `problem`: counts the evaluations.
    """

    def __init__(self, judge: Judge, how: Front, rng: np.random.Generator) -> None:
        self.judge, self.problem, self.rng = judge, judge.problem, rng
        self._low, self._high = judge.problem.limits.T
        start = (judge.problem.start[judge.problem.free] - self._low) / (self._high - self._low)
        self._frontier = how.frontier
        self.chart = Chart(judge.low, judge.high)
        self._postures = Rows(start.shape)  # the free motors in fractions of their ranges
        self.schedule = SearchSchedule(self.chart, self._postures, start, how, how.population or default_population(len(start)), rng)
        self._best, self._best_cost = start, np.inf  # of the search for the first pose

    @property
    def vertices(self) -> int:
        """How many there are."""
        return len(self.chart)

    @property
    def open(self) -> int:
        """How many vertices may still be searched from."""
        return int(self.schedule.may_grow().sum())

    def result(self) -> tuple[Array, Array]:
        """Poses (V, n) rad and their task coordinates (V, m)."""
        return self._poses(self._postures.all), self.chart.places * self.judge.spacing

    def begin_from(self, q: Array, y: Array) -> None:
        """Take poses q (V, n) rad, at task coordinates y (V, m), for the first vertices."""
        postures = (q[:, self.problem.free] - self._low) / (self._high - self._low)
        for posture, place in zip(postures, y / self.judge.spacing, strict=True):
            self._add(posture, place)

    def step(self) -> bool:
        """A generation of all searches, and what follows from it; False: nothing is left to search from.

        Raises:
            MobeeError: no first pose was found.
        """
        self.schedule.refill()
        which = np.flatnonzero(self.schedule.vertex != IDLE)
        if not len(which):
            if self.schedule.exhausted:
                raise MobeeError(self._nothing())
            return False
        searches = self.schedule.searches
        z = self.rng.standard_normal((len(which), searches.population, len(self._low)))
        samples = searches.ask(which, z)
        inside = np.minimum(np.maximum(samples, 0.0), 1.0)
        seen = self.judge.look(self._poses(inside.reshape(-1, inside.shape[-1])))
        places, cost, good = seen.place.reshape(*z.shape[:2], -1), seen.cost.reshape(z.shape[:2]), seen.good.reshape(z.shape[:2])
        if len(self.chart):
            more, spread = self._spread(which, places)
            cost, good = cost + more, good & spread
        elif cost.min() < self._best_cost:
            self._best, self._best_cost = inside.reshape(-1, inside.shape[-1])[cost.argmin()], float(cost.min())
        searches.tell(which, z, cost + BEYOND * ((samples - inside) ** 2).sum(axis=2))
        for k in np.flatnonzero(good.any(axis=1)):
            if self.schedule.vertex[which[k]] != IDLE:
                self._commit(int(which[k]), inside[k], places[k], np.where(good[k], cost[k], np.inf))
        self.schedule.give_up()
        return True

    def state(self) -> dict[str, NDArray[Any]]:
        """All that `restore` needs, but for the generator; with the vertices' poses "q" and task coordinates "y"."""
        q, y = self.result()
        known = {"q": q, "y": y, "postures": self._postures.all, "places": self.chart.places, "weights": self.chart.weights}
        return self.schedule.state() | known | {"best": self._best, "best_cost": np.array(self._best_cost)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on where `state` was taken, by a growth of the same settings."""
        for posture, place in zip(state["postures"], state["places"], strict=True):
            self._add(posture, place)
        self.chart.weights[:] = state["weights"]
        self.schedule.restore(state)
        self._best, self._best_cost = state["best"], float(state["best_cost"])

    def _add(self, posture: Array, place: Array) -> Array | None:
        self._postures.append(posture)
        return self.chart.add(place)

    def _poses(self, postures: Array) -> Array:
        """All motors (N, n) rad from fractions of the ranges of the free ones (N, d)."""
        return self.problem.whole(np.minimum(self._low + postures * (self._high - self._low), self._high))

    def _spread(self, which: Ints, places: Array) -> tuple[Array, Flags]:
        """Eq. 3.6 and the aims at places (k, population, m), and which of them keep their distance to what is near, (k, population)."""
        n = min(self.chart.dimensions, len(self.chart))
        apart = ((places[:, :, None] - self.schedule.near[which, None]) ** 2).sum(axis=-1)
        nearest = np.sqrt(np.sort(np.partition(apart, n - 1, axis=-1)[..., :n], axis=-1))
        cost: Array = (((nearest - 1.0) / REPELLED) ** 2).sum(axis=-1)
        if self._frontier:
            cost += ((places - self.schedule.aim[which, None]) ** 2).sum(axis=-1) / AIMED**2
        good: Flags = (nearest[..., 0] >= NEAREST) & (nearest[..., 0] <= FIRST) & (nearest[..., -1] <= OTHERS)
        return cost, good

    def _commit(self, number: int, postures: Array, places: Array, cost: Array) -> None:
        """Add the cheapest sample of a search that the map as it is now accepts, and end the search."""
        for k in np.argsort(cost, kind="stable"):
            if not np.isfinite(cost[k]):
                return
            if self.chart.accepts(places[k]):
                self.schedule.found(number, places[k], self._add(postures[k], places[k]))
                return

    def _nothing(self) -> str:
        return (
            f"no pose was found that meets all costs inside the task's box, by {self.problem.evaluations} evaluations from the start and "
            f"from elsewhere. The nearest misses {self.judge.missed(self._poses(self._best[None])[0])}. Loosen a tolerance, widen the box, "
            f"let more motors move, or begin nearer (start)."
        )
