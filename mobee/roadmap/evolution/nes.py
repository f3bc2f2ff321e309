# SPDX-License-Identifier: Apache-2.0
"""Natural evolution strategies: sampling, rank weights, natural-gradient updates (Glasmachers et al. 2010, thesis 3.2)."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array, checked_count, real_array
from mobee.errors import InvalidValue, UnknownName


@dataclass(frozen=True, slots=True, eq=False)
class PathRates:
    """Weights and learning rates of an evolution strategy with an evolution path: those of CMA-ES (Hansen 2016, arXiv:1604.00772).

    Attributes:
        weights: (population,), best sample first; the weights of the better half are positive and their sum is 1, the others are negative.
        effective: effective number of samples in the better half.
        path: share of the evolution path (a mean of recent steps of the search) that is replaced in each generation.
        damping: damping of the changes of the step size.
        rank_one: learning rate of the shape matrix of the search distribution from the path.
        rank_all: learning rate of the shape matrix from the samples.
        length: mean length of a standard normal vector.
    """

    weights: Array
    effective: float
    path: float
    damping: float
    rank_one: float
    rank_all: float
    length: float


def path_rates(dimensions: int, population: int, separable: bool = False) -> PathRates:
    """Return the default sample weights and learning rates of an evolution strategy with an evolution path, those of CMA-ES.

    `dimensions`: number of variables of the search. `population`: number of samples per generation. `separable`: True: for a search
    distribution with a diagonal shape matrix, which has fewer parameters, so that it can be learned faster (Ros and Hansen 2008).
    """
    d = dimensions
    weights = math.log((population + 1) / 2) - np.log(np.arange(1, population + 1))
    better, worse = weights[weights > 0.0], weights[weights <= 0.0]
    effective = float(better.sum() ** 2 / (better**2).sum())
    path = (effective + 2.0) / (d + effective + 5.0)
    damping = 1.0 + 2.0 * max(0.0, math.sqrt((effective - 1.0) / (d + 1.0)) - 1.0) + path
    rank_one = 2.0 / ((d + 1.3) ** 2 + effective)
    rank_all = 2.0 * (0.25 + effective + 1.0 / effective - 2.0) / ((d + 2.0) ** 2 + effective)
    faster = (d + 2.0) / 3.0 if separable else 1.0
    rank_one = min(0.5, rank_one * faster)
    rank_all = min(1.0 - rank_one, rank_all * faster)
    weights[weights > 0.0] /= better.sum()
    if worse.any():
        of_worse = float(worse.sum() ** 2 / (worse**2).sum())
        most = min(1.0 + rank_one / rank_all, 1.0 + 2.0 * of_worse / (effective + 2.0), (1.0 - rank_one - rank_all) / (d * rank_all))
        weights[weights < 0.0] *= most / -worse.sum()
    length = math.sqrt(d) * (1.0 - 1.0 / (4.0 * d) + 1.0 / (21.0 * d * d))
    return PathRates(weights, effective, path, damping, rank_one, rank_all, length)


def published_utilities(population: int) -> Array:
    """Return the utilities (weights) of the samples in xNES and SNES as published, (population,), best sample first.

    Their sum is 0 (Glasmachers et al. 2010).
    """
    better = np.maximum(0.0, math.log(population / 2 + 1) - np.log(np.arange(1, population + 1)))
    utilities: Array = better / better.sum() - 1.0 / population
    return utilities


def default_population(dimensions: int) -> int:
    """Return the default number of samples per generation, 4 + 3 ln(dimensions), rounded down."""
    return 4 + int(3.0 * math.log(dimensions))


_NEGLIGIBLE = 1e-17


def turned(shape: Array, z: Array, weights: Array, shrink: float) -> Array:
    """Return the updated shape B exp(1/2 (sum_i weights_i z_i z_i^T - shrink I)) of a search distribution, exact to rounding.

    `shape`: B (d, d), or its diagonal (d,); the result has the same form. `z`: (k, d) standard normal samples. `weights`: (k,).
    `shrink`: factor of the identity I. The sum has at most rank k; for k < d the Taylor series of the exponential is therefore computed
    with matrices (k, k).
    """
    if shape.ndim == 1:
        diagonal: Array = shape * np.exp(0.5 * (weights @ z**2 - shrink))
        return diagonal
    weighted = z * (0.5 * weights)[:, None]
    if len(z) < len(shape):
        change = (shape @ z.T) @ (_series(weighted @ z.T) @ weighted)
    else:
        exponent = weighted.T @ z
        change = shape @ (exponent @ _series(exponent))
    whole: Array = math.exp(-0.5 * shrink) * (shape + change)
    return whole


def _series(a: Array) -> Array:
    """Return (exp(a) - 1) / a of a matrix a, by its Taylor series; the exponents of one generation are small."""
    norm, size, power = math.sqrt(float((a * a).sum())), 1.0, 1
    total = term = np.eye(len(a))
    while size > _NEGLIGIBLE:
        power += 1
        size *= norm / power
        term = term @ a
        term *= 1.0 / power
        total = total + term
    return total


def stretched(shape: Array, z: Array) -> Array:
    """Return B z for samples z (k, d), or for one sample (d,); `shape`: B (d, d), or its diagonal (d,)."""
    moved: Array = z * shape if shape.ndim == 1 else z @ shape.T
    return moved


Method = Literal["full", "separable", "xnes", "snes"]
METHODS: tuple[str, ...] = get_args(Method)


def checked_begin(start: ArrayLike, std: ArrayLike) -> tuple[Array, Array]:
    """Return the first mean (d,) and the first standard deviations (d,) of a search; raises InvalidValue if they are not valid."""
    mean, spread = real_array("start", start), real_array("std", std)
    if mean.ndim != 1 or not len(mean) or not np.isfinite(mean).all():
        raise InvalidValue(f"start has shape {mean.shape}; it must be (d,) finite numbers, d at least 1.")
    if spread.shape not in ((), (1,), mean.shape):
        raise InvalidValue(f"std has shape {spread.shape}; it must be one number, or ({len(mean)},) like the start.")
    if not (np.isfinite(spread).all() and (spread > 0.0).all()):
        raise InvalidValue(f"std is {std!r}; it must be finite and above 0.")
    return mean, np.broadcast_to(spread, mean.shape).copy()


def checked_costs(costs: ArrayLike, population: int) -> Array:
    """Return the costs (population,) of a generation; raises InvalidValue for another shape, or if one of them is NaN."""
    values = real_array("costs", costs)
    if values.shape != (population,):
        raise InvalidValue(f"costs have shape {values.shape}; they must be ({population},) numbers, one for each sample.")
    if np.isnan(values).any():
        nans = int(np.isnan(values).sum())
        raise InvalidValue(f"{nans} of {population} costs are NaN; a cost must be a number, inf where a sample is not valid.")
    return values


class NES:
    """A natural evolution strategy: `ask` returns a generation of samples, `tell` updates the search distribution by their costs.

    The same seed gives the same samples.  Only the order of the costs matters: any increasing function of the costs gives the same search.

    Args:
        start: (d,) first mean of the search distribution.
        std: first standard deviation, one number or (d,).
        population: samples per generation, at least 4; None: 4 + 3 ln(d), rounded down.
        method: "full": exponential NES with an evolution path, and negative weights for the worse samples.  "separable": the same with a
            diagonal shape matrix, for many dimensions.  "xnes" and "snes": NES with a full and with a diagonal shape matrix as published,
            with the published learning rates; they usually need more samples than "full" and "separable" (docs/roadmaps.md).
        seed: seed of the samples, or a generator that draws them.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __init__(
        self,
        start: ArrayLike,
        std: ArrayLike,
        population: int | None = None,
        method: Method = "full",
        seed: int | np.random.Generator = 0,
    ) -> None:
        mean, scale = checked_begin(start, std)
        if method not in METHODS:
            raise UnknownName("method", method, METHODS)
        d = len(mean)
        size = default_population(d) if population is None else checked_count("population", population, 4)
        self.mean = mean
        self.sigma = 1.0  # in units of the std at the start
        self.shape = np.ones(d) if method in ("separable", "snes") else np.eye(d)
        self.path = np.zeros(d)
        self.population = size
        self.generations = 0
        self._scale = scale
        self._published = method in ("xnes", "snes")
        self._rates = path_rates(d, size, separable=method == "separable")
        self._utilities = published_utilities(size)
        self._rng = np.random.default_rng(seed)
        self._z: Array | None = None

    @property
    def std(self) -> Array:
        """The present standard deviation along each coordinate, (d,)."""
        spread = self.shape if self.shape.ndim == 1 else np.sqrt((self.shape**2).sum(axis=1))
        deviation: Array = self.sigma * self._scale * spread
        return deviation

    def ask(self) -> Array:
        """Return the next generation of samples, (population, d); a second call before `tell` draws other samples."""
        self._z = self._rng.standard_normal((self.population, len(self.mean)))
        samples: Array = self.mean + self.sigma * self._scale * stretched(self.shape, self._z)
        return samples

    def tell(self, costs: ArrayLike) -> None:
        """Update the distribution by the costs (population,) of the samples from `ask`; +inf is worst, NaN raises InvalidValue."""
        values = checked_costs(costs, self.population)
        if self._z is None:
            raise InvalidValue("tell without ask: the costs belong to samples; ask first.")
        z = self._z[np.argsort(values, kind="stable")]
        self._z = None
        self.generations += 1
        if self._published:
            self._follow_published(z)
        else:
            self._follow(z)

    def _follow(self, z: Array) -> None:
        """Update the mean, the step size and the shape of the search distribution; used if `method` is "full" or "separable".

        `z`: (population, d), the standard normal vectors from which `ask` computed the last samples, that of the lowest cost first; d is
        the number of variables. The mean moves by the weighted sum of the better half of the samples. The length of the evolution path (a
        weighted sum of recent steps of the mean) changes the step size `sigma`. The path and all samples change the shape matrix, which is
        diagonal for "separable". For this, vectors z with negative weights are first scaled to the length sqrt(d).
        """
        rates, d = self._rates, len(self.mean)
        positive = np.maximum(rates.weights, 0.0)
        step = positive @ z
        self.mean = self.mean + self.sigma * self._scale * stretched(self.shape, step)
        self.path = (1.0 - rates.path) * self.path + math.sqrt(rates.path * (2.0 - rates.path) * rates.effective) * step
        growth = rates.path / rates.damping * (float(np.linalg.norm(self.path)) / rates.length - 1.0)
        self.sigma *= math.exp(min(1.0, growth))
        lengths = (z**2).sum(axis=1)
        weights = np.where(rates.weights < 0.0, rates.weights * d / lengths, rates.weights)
        shrink = rates.rank_one + rates.rank_all * rates.weights.sum()
        directions = np.concatenate([self.path[None], z])
        self.shape = turned(self.shape, directions, np.concatenate([[rates.rank_one], rates.rank_all * weights]), shrink)

    def _follow_published(self, z: Array) -> None:
        """Update the mean, the step size and the shape of the search distribution as published; used if `method` is "xnes" or "snes".

        `z`: as for `_follow`. For "xnes", the trace of the natural gradient (d, d) changes the step size `sigma`, and the remainder changes
        the shape matrix. For "snes", the gradient changes the diagonal shape matrix, and `sigma` stays 1 (Glasmachers et al. 2010).
        """
        u, d = self._utilities, len(self.mean)
        self.mean = self.mean + self.sigma * self._scale * stretched(self.shape, u @ z)
        if self.shape.ndim == 1:
            self.shape = turned(self.shape, z, (3.0 + math.log(d)) / (5.0 * math.sqrt(d)) * u, 0.0)
            return
        rate = 0.6 * (3.0 + math.log(d)) / (d * math.sqrt(d))
        trace = float(u @ (z**2).sum(axis=1)) / d
        self.sigma *= math.exp(0.5 * rate * trace)
        self.shape = turned(self.shape, z, rate * u, rate * trace)
