# SPDX-License-Identifier: Apache-2.0
"""Searches by evolution strategy within a box, with restarts; several at once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, Ints, real_array
from mobee.errors import InvalidValue
from mobee.roadmap.evolution.nes import NES, Method, checked_begin, checked_costs, path_rates

_NEGLIGIBLE = 1e-12


class Searches:
    """The normal distributions of L = `count` simultaneous searches over d = `dimensions` coordinates.

    Samples are mean + sigma * shape @ z, with z standard normal. The following arrays contain the state of all searches. `mean` (L, d).
    `sigma` (L,): step size. `shape` (L, d, d). `path` (L, d): evolution path. `age` (L,): generations since the search began. `population`:
    samples per generation of each search.
    """

    def __init__(self, count: int, dimensions: int, population: int) -> None:
        self.mean = np.zeros((count, dimensions))
        self.sigma = np.zeros(count)
        self.shape = np.zeros((count, dimensions, dimensions))
        self.path = np.zeros((count, dimensions))
        self.age = np.zeros(count, dtype=np.int64)
        self.population = population
        self._rates = path_rates(dimensions, population)

    def begin(self, number: int, mean: Array, std: float) -> None:
        """Start search `number` anew at a mean (d,), with the same standard deviation `std` in all coordinates."""
        self.mean[number], self.sigma[number], self.age[number] = mean, std, 0
        self.shape[number], self.path[number] = np.eye(len(mean)), 0.0

    def ask(self, which: Ints, z: Array) -> Array:
        """Return samples (k, population, d) of the searches with indices `which` (k,); `z`: standard normal samples of the same shape."""
        samples: Array = self.mean[which, None] + self.sigma[which, None, None] * (z @ self.shape[which].transpose(0, 2, 1))
        return samples

    def tell(self, which: Ints, z: Array, costs: Array) -> None:
        """Update the distributions of the k searches with the indices `which` (k,).

        `z`: (k, population, d), the standard normal samples given to `ask`. `costs`: (k, population) of these samples; the lowest is best.
        """
        rates, d = self._rates, z.shape[-1]
        z = np.take_along_axis(z, np.argsort(costs, axis=1, kind="stable")[:, :, None], axis=1)
        shape, sigma = self.shape[which], self.sigma[which]
        step = np.maximum(rates.weights, 0.0) @ z
        self.mean[which] += sigma[:, None] * (shape @ step[:, :, None])[..., 0]
        path = (1.0 - rates.path) * self.path[which] + math.sqrt(rates.path * (2.0 - rates.path) * rates.effective) * step
        self.path[which] = path
        growth = rates.path / rates.damping * (np.sqrt((path**2).sum(axis=1)) / rates.length - 1.0)
        self.sigma[which] = sigma * np.exp(np.minimum(1.0, growth))
        lengths = (z**2).sum(axis=2)
        weights = np.where(rates.weights < 0.0, rates.weights * d / lengths, rates.weights)
        shrink = rates.rank_one + rates.rank_all * rates.weights.sum()
        exponent = 0.5 * (z * (rates.rank_all * weights)[:, :, None]).transpose(0, 2, 1) @ z
        exponent += 0.5 * rates.rank_one * path[:, :, None] * path[:, None, :]
        self.shape[which] = math.exp(-0.5 * shrink) * (shape + shape @ (exponent @ _series(exponent)))
        self.age[which] += 1


def _series(a: Array) -> Array:
    """Return (exp(a) - 1) / a of matrices (k, d, d) by Taylor series."""
    norm, size, power = math.sqrt(float((a * a).sum(axis=(1, 2)).max())), 1.0, 1
    term = np.broadcast_to(np.eye(a.shape[-1]), a.shape)
    total = term.copy()
    while size > _NEGLIGIBLE:
        power += 1
        size *= norm / power
        term = term @ a / power
        total += term
    return total


PENALTY = 100.0  # on the cost of a sample that was moved into the box: times its squared distance in box widths
EVALUATIONS = 100_000


@dataclass(frozen=True, slots=True)
class Restart:
    """Two conditions, of which each restarts a search: a narrow distribution, and a cost that no longer decreases.

    Restarts begin alternately at a random point of the box and at the `start` of the search.

    `std`: restart if the largest standard deviation is below this fraction of the box's width. `patience`, `gain`: the best cost since the
    last start is compared every `patience` generations; restart if it has decreased by less than the fraction `gain` since the comparison
    before.
    """

    std: float = 1e-3
    patience: int = 40
    gain: float = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Minimum:
    """The result of `minimize`.

    `x`: (d,) the best sample. `cost`: its cost. `evaluations`: number of evaluated samples. `starts`: number of starts (1: no restart).
    """

    x: Array
    cost: float
    evaluations: int
    starts: int


class Search:
    """A search in a box: `ask` returns a generation of samples, `tell` updates the search by their costs.

    `best` and `best_cost` are the best sample (d,) of all generations and its cost; `evaluations` and `starts` are the numbers of evaluated
    samples and of starts.

    Args:
        start: (d,) first mean of the search distribution.
        std: first standard deviation, one number or (d,).
        limits: (d, 2) box; samples outside are moved to its border, at an additional cost.  None: no box.
        restart: when to restart; needs limits.  None: never.
        population: samples per generation, at least 4; None: 4 + 3 ln(d), rounded down.
        method: "full", "separable", "xnes" or "snes", as in `NES`.
        seed: seed of the random numbers, or a generator that draws them.

    Raises:
        InvalidValue, UnknownName: an argument is not valid; the message states the valid values.
    """

    def __init__(
        self,
        start: ArrayLike,
        std: ArrayLike,
        limits: ArrayLike | None = None,
        restart: Restart | None = None,
        population: int | None = None,
        method: Method = "full",
        seed: int | np.random.Generator = 0,
    ) -> None:
        first, spread = checked_begin(start, std)
        if limits is None and restart is not None:
            raise InvalidValue("a restart begins at a random place of the box, so it needs limits (d, 2).")
        self._low, self._high = np.zeros(first.shape), np.ones(first.shape)
        if limits is not None:
            self._low, self._high = _box(limits, first)
        self._width = self._high - self._low
        self._boxed = limits is not None
        self._restart = restart
        self._rng = np.random.default_rng(seed)
        self._first = (first - self._low) / self._width
        self._std = spread / self._width
        self._how = population, method
        self._nes = NES(self._first, self._std, population, method, self._rng)
        self._beyond = np.zeros(self._nes.population)
        self._asked = np.empty(0)
        self._known = math.inf  # best cost since the last start, and the one before so many generations
        self._before: float | None = None
        self._since = 0
        self.best = first
        self.best_cost = math.inf
        self.evaluations = 0
        self.starts = 1

    @property
    def population(self) -> int:
        """Number of samples per generation."""
        return self._nes.population

    def ask(self) -> Array:
        """Return the next generation of samples, (population, d), inside the box."""
        places = self._nes.ask()
        if not self._boxed:
            self._asked = places
            return places.copy()  # the caller may compute in place
        inside = np.minimum(np.maximum(places, 0.0), 1.0)
        self._beyond = ((places - inside) ** 2).sum(axis=1)
        self._asked = np.minimum(self._low + inside * self._width, self._high)  # rounding must not lead out of the box
        return self._asked.copy()

    def tell(self, costs: ArrayLike) -> None:
        """Update the search with the costs (population,) of the samples from `ask`; restart it if the condition `restart` holds."""
        values = checked_costs(costs, self._nes.population)
        self._nes.tell(values + PENALTY * self._beyond)
        self.evaluations += len(values)
        least = int(values.argmin())
        self._known = min(self._known, float(values[least]))
        if values[least] < self.best_cost:
            self.best, self.best_cost = self._asked[least].copy(), float(values[least])
        if self._restart is not None and self._stuck(self._restart):
            self.starts += 1
            start = self._rng.uniform(size=len(self._first)) if self.starts % 2 == 0 else self._first
            self._nes = NES(start, self._std, *self._how, self._rng)
            self._known, self._before, self._since = math.inf, None, 0

    def _stuck(self, restart: Restart) -> bool:
        self._since += 1
        if self._since >= restart.patience:
            if self._before is not None:
                gain = restart.gain * abs(self._before) if math.isfinite(self._before) else 0.0
                if not self._known < self._before - gain:
                    return True
            self._before, self._since = self._known, 0
        return bool(self._nes.std.max() < restart.std)


def minimize(
    cost: Callable[[Array], ArrayLike],
    start: ArrayLike,
    std: ArrayLike,
    limits: ArrayLike | None = None,
    target: float = -math.inf,
    evaluations: int = EVALUATIONS,
    restart: Restart | None = None,
    population: int | None = None,
    method: Method = "full",
    seed: int | np.random.Generator = 0,
) -> Minimum:
    """Minimise a cost until a sample costs at most `target`, or until the number of `evaluations`, at least one generation, is used up.

    `cost`: takes samples (population, d) and returns their costs (population,). `start` (d,), `std` (one number or (d,)): first mean and
    standard deviation of the search distribution. `limits`: (d, 2) box, in which the samples stay; None: no box. `restart`: when to
    restart; it needs limits; None: never. `population`: samples per generation, at least 4; None: 4 + 3 ln(d), rounded down. `method`:
    "full", "separable", "xnes" or "snes", as in `NES`. `seed`: seed of the random numbers, or a generator. Raises InvalidValue or
    UnknownName for an argument that is not valid.
    """
    search = Search(start, std, limits, restart, population, method, seed)
    if not evaluations >= search.population:
        raise InvalidValue(f"evaluations {evaluations!r}: must be at least {search.population}, one generation.")
    if math.isnan(target):
        raise InvalidValue("target is nan; it must be a number, -inf for none.")
    while search.best_cost > target:
        samples = search.ask()
        if search.evaluations + len(samples) > evaluations:
            break
        search.tell(cost(samples))
    return Minimum(search.best, search.best_cost, search.evaluations, search.starts)


def _box(limits: ArrayLike, start: Array) -> tuple[Array, Array]:
    """Return the lowest and the highest corner of the box, (d,) each; raises InvalidValue."""
    box = real_array("limits", limits)
    if box.shape != (*start.shape, 2) or not np.isfinite(box).all() or not (box[:, 0] < box[:, 1]).all():
        raise InvalidValue(
            f"limits have shape {box.shape}; they must be ({len(start)}, 2) finite numbers, the first of a row below the second."
        )
    return box[:, 0], box[:, 1]
