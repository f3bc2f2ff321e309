"""The advancing front of thesis Algorithms 3 and 4: searches begin at the vertices of a map and end beside them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.errors import MobeeError
from mobee.roadmap.chart import FIRST, NEAREST, OTHERS, Chart
from mobee.roadmap.front import Front
from mobee.roadmap.judge import Judge
from mobee.roadmap.prediction import predicted
from mobee.roadmap.rates import default_population
from mobee.roadmap.region import Flags
from mobee.roadmap.rows import Rows
from mobee.roadmap.searches import Searches
from mobee.robot.robot import Array, Ints

REPELLED = 0.25  # spacings: what eq. 3.6 counts beside a term at its tolerance
AIMED = 0.5  # spacings: what a free place counts
BEYOND = 1000.0  # of a sample that was moved back into the limits: times its squared way in ranges
APART = 2.0 * NEAREST  # spacings between what two searches aim at
ALIKE = 0.5  # spacings: aims nearer than this are one for the count of failures
FIRST_AT_ONCE, FIRST_MOST = 4, 60  # searches for the first pose
FIRST_PATIENCE = 30  # generations a motor, where nothing is known of how long a search takes
RECENT, ENOUGH = 200, 8  # successes that tell
LEAST = 100  # generations over the dimensions of the task space, that a search has at least
WIDER = 4  # times as many for one after another has failed there
MOVE, NARROW = 0.5, 0.003  # a standard deviation: this share of the move that is predicted; and the least one, in ranges
STALLED = 1e-4  # of the ranges: a search that is as narrow has failed
_IDLE, _FIRST = -1, -2  # instead of a vertex that a search began at


class Growth:
    """A map that grows: `step` goes on with every search by a generation and adds what they found.

    `chart`: the vertices in the task space.  `postures` (V, d): the free motors in fractions of their ranges.
    """

    def __init__(self, judge: Judge, how: Front, rng: np.random.Generator) -> None:
        self.judge, self.how, self.rng = judge, how, rng
        self.problem = judge.problem
        self._low, self._high = judge.problem.limits.T
        self._start = (judge.problem.start[judge.problem.free] - self._low) / (self._high - self._low)
        d, count = len(self._low), how.searches
        self.chart = Chart(judge.low, judge.high)
        self._postures = Rows((d,))
        self._failed = Rows((self.chart.dimensions,))
        self._searches = Searches(count, d, how.population or default_population(d))
        self._vertex = np.full(count, _IDLE)
        self._aim = np.full((count, self.chart.dimensions), np.nan)
        self._patience = np.zeros(count, dtype=np.int64)
        self._near = np.full((count, 16 * 2 ** min(self.chart.dimensions, 4), self.chart.dimensions), np.inf)
        self._begun = 0
        self._ages = Rows((), np.int64)  # generations that searches took which succeeded
        self.best, self.best_cost = self._start, np.inf  # of the search for the first pose

    @property
    def vertices(self) -> int:
        """How many there are."""
        return len(self.chart)

    @property
    def open(self) -> int:
        """How many vertices may still be searched from."""
        return int(self._may_grow().sum())

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
        self._refill()
        which = np.flatnonzero(self._vertex != _IDLE)
        if not len(which):
            return False
        z = self.rng.standard_normal((len(which), self._searches.population, len(self._low)))
        samples = self._searches.ask(which, z)
        inside = np.minimum(np.maximum(samples, 0.0), 1.0)
        seen = self.judge.look(self._poses(inside.reshape(-1, inside.shape[-1])))
        places, cost, good = seen.place.reshape(*z.shape[:2], -1), seen.cost.reshape(z.shape[:2]), seen.good.reshape(z.shape[:2])
        if len(self.chart):
            more, spread = self._spread(which, places)
            cost, good = cost + more, good & spread
        elif cost.min() < self.best_cost:
            self.best, self.best_cost = inside.reshape(-1, inside.shape[-1])[cost.argmin()], float(cost.min())
        self._searches.tell(which, z, cost + BEYOND * ((samples - inside) ** 2).sum(axis=2))
        for k in np.flatnonzero(good.any(axis=1)):
            self._commit(int(which[k]), inside[k], places[k], np.where(good[k], cost[k], np.inf))
        self._give_up()
        return True

    def state(self) -> dict[str, NDArray[Any]]:
        """All that `restore` needs, but for the generator."""
        lanes = {name: getattr(self._searches, name) for name in ("mean", "sigma", "shape", "path", "age")}
        own = {"vertex": self._vertex, "aim": self._aim, "patience": self._patience, "begun": np.array(self._begun)}
        rows = {"postures": self._postures, "failed": self._failed, "ages": self._ages}
        known = {name: one.all for name, one in rows.items()} | {"places": self.chart.places, "weights": self.chart.weights}
        q, y = self.result()
        return lanes | own | known | {"q": q, "y": y, "best": self.best, "best_cost": np.array(self.best_cost)}

    def restore(self, state: Mapping[str, NDArray[Any]]) -> None:
        """Go on where `state` was taken, by a growth of the same settings."""
        for posture, place in zip(state["postures"], state["places"], strict=True):
            self._add(posture, place)
        self.chart.weights[:] = state["weights"]
        for rows, name in ((self._failed, "failed"), (self._ages, "ages")):
            for row in state[name]:
                rows.append(row)
        for name in ("mean", "sigma", "shape", "path", "age"):
            getattr(self._searches, name)[:] = state[name]
        self._vertex[:], self._aim[:], self._patience[:] = state["vertex"], state["aim"], state["patience"]
        self._begun, self.best, self.best_cost = int(state["begun"]), state["best"], float(state["best_cost"])
        for number in np.flatnonzero(self._vertex >= 0):
            self._look_around(int(number))

    def _add(self, posture: Array, place: Array) -> None:
        self.chart.add(place)
        self._postures.append(posture)

    def _poses(self, postures: Array) -> Array:
        """All motors (N, n) rad from fractions of the ranges of the free ones (N, d)."""
        return self.problem.whole(np.minimum(self._low + postures * (self._high - self._low), self._high))

    def _spread(self, which: Ints, places: Array) -> tuple[Array, Flags]:
        """Eq. 3.6 and the aims at places (k, population, m), and which of them keep their distance to what is near, (k, population)."""
        n = min(self.chart.dimensions, len(self.chart))
        apart = np.sqrt(((places[:, :, None] - self._near[which, None]) ** 2).sum(axis=-1))
        nearest = np.partition(apart, n - 1, axis=-1)[..., :n]
        nearest.sort(axis=-1)
        cost: Array = (((nearest - 1.0) / REPELLED) ** 2).sum(axis=-1)
        if self.how.frontier:
            cost += ((places - self._aim[which, None]) ** 2).sum(axis=-1) / AIMED**2
        good: Flags = (nearest[..., 0] >= NEAREST) & (nearest[..., 0] <= FIRST) & (nearest[..., -1] <= OTHERS)
        return cost, good

    def _commit(self, number: int, postures: Array, places: Array, cost: Array) -> None:
        """Add the cheapest sample of a search that the map as it is now accepts, and end what it makes pointless."""
        for k in np.argsort(cost, kind="stable"):
            if not np.isfinite(cost[k]):
                return
            if self.chart.accepts(places[k]):
                break
        else:
            return
        if self._vertex[number] >= 0:
            self._ages.append(self._searches.age[number])
        self._add(postures[k], places[k])
        self._vertex[number] = _IDLE
        self._vertex[self._vertex == _FIRST] = _IDLE
        for other in np.flatnonzero(self._vertex >= 0).tolist():
            if ((self._centre(other) - places[k]) ** 2).sum() < 16.0:
                self._look_around(other)
                if self.how.frontier and not self.chart.is_free(self._aim[other]):
                    self._vertex[other] = _IDLE  # not its fault

    def _give_up(self) -> None:
        """End the searches that have failed, and lower the weights of where they began."""
        over = (self._vertex != _IDLE) & ((self._searches.age >= self._patience) | (self._searches.sigma < STALLED))
        for number in np.flatnonzero(over & (self._vertex >= 0)):
            self.chart.weights[self._vertex[number]] -= self.how.delta
            self._failed.append(self._aim[number])
        self._vertex[over] = _IDLE

    def _may_grow(self) -> Flags:
        able: Flags = self.chart.weights > 0.0
        return able & self.chart.free.any(axis=1) if self.how.frontier else able

    def _refill(self) -> None:
        """Begin searches where there is room for them: heaviest vertex first, of equal ones the oldest."""
        room = np.flatnonzero(self._vertex == _IDLE).tolist()
        if not len(self.chart):
            self._refill_first(room)
            return
        if not room:
            return
        able = np.flatnonzero(self._may_grow())
        busy = [self._centre(int(k)) for k in np.flatnonzero(self._vertex != _IDLE)]
        for vertex in able[np.argsort(-self.chart.weights[able], kind="stable")]:
            if not room:
                return
            places = self._places_to_go(vertex)
            if busy:
                places = places[((places[:, None] - np.array(busy)) ** 2).sum(axis=-1).min(axis=1) >= APART**2]
            if len(places) and self._begin(room[0], vertex, places):
                busy.append(self._centre(room.pop(0)))

    def _refill_first(self, room: list[int]) -> None:
        """Search for a first pose, in turn from the start and from anywhere."""
        going = int((self._vertex == _FIRST).sum())
        if self._begun >= FIRST_MOST and not going:
            raise MobeeError(
                f"no pose was found that meets all costs inside the task's box, by {self.problem.evaluations} evaluations from the "
                f"start and from elsewhere. The nearest misses {self.judge.missed(self._poses(self.best[None])[0])}. Loosen a tolerance, "
                f"widen the box, let more motors move, or begin nearer (start)."
            )
        for number in room[: max(0, FIRST_AT_ONCE - going)]:
            if self._begun >= FIRST_MOST:
                return
            mean = self._start if self._begun % 2 == 0 else self.rng.uniform(size=len(self._start))
            self._begun += 1
            self._searches.begin(number, mean, self.how.wide_std)
            self._vertex[number], self._patience[number] = _FIRST, FIRST_PATIENCE * len(self._start)

    def _places_to_go(self, vertex: int) -> Array:
        """What a search from a vertex may aim at, (k, m); without aims, the vertex's own place."""
        here = self.chart.places[vertex]
        if not self.how.frontier:
            return np.array([here])
        around: Array = here + self.chart.ways[self.chart.free[vertex]]
        return around

    def _begin(self, number: int, vertex: int, places: Array) -> bool:
        """Begin a search from a vertex to one of the places (k, m), with the fewest failures about it; False: all out of reach."""
        mean, std, patience = self._postures.all[vertex], self.how.std, self._patient()
        if self.how.frontier:
            failed = (((places[:, None] - self._failed.all) ** 2).sum(axis=-1) < ALIKE**2).sum(axis=1)
            if failed.min() >= self.how.tries:
                self.chart.weights[vertex] = 0.0
                return False
            places = places[failed == failed.min()]
            self._aim[number] = places[self.rng.integers(len(places))]
            if failed.min() > 0:
                std, patience = self.how.wide_std, WIDER * patience
            elif self.how.predict:
                mean = predicted(self.chart, self._postures.all, vertex, self._aim[number])
                move = float(np.sqrt(((mean - self._postures.all[vertex]) ** 2).mean()))
                std = min(max(MOVE * move, NARROW), std)
        self._vertex[number], self._patience[number] = vertex, patience
        self._searches.begin(number, mean, std)
        self._look_around(number)
        return True

    def _patient(self) -> int:
        """Generations after which a search has failed, by what those took that did not."""
        ages = self._ages.all[-RECENT:]
        if len(ages) < ENOUGH:
            return FIRST_PATIENCE * len(self._start)
        return max(LEAST // self.chart.dimensions, int(self.how.patience * np.quantile(ages, 0.75)))

    def _centre(self, number: int) -> Array:
        """Where a search may be expected to end, or where it began."""
        place: Array = self._aim[number] if self.how.frontier else self.chart.places[self._vertex[number]]
        return place

    def _look_around(self, number: int) -> None:
        """Tell a search the vertices that are near."""
        near, _ = self.chart.nearest(self._centre(number), self._near.shape[1])
        self._near[number] = np.inf
        self._near[number, : len(near)] = self.chart.places[near]
