"""How much each sample of a generation counts, and how fast a search distribution follows."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True, eq=False)
class PathRates:
    """Weights and rates of an evolution strategy with a path: those of CMA-ES (Hansen 2016, arXiv:1604.00772).

    `weights` (population,), best sample first: the better half's are positive and sum up to 1, the others' are negative.
    """

    weights: Array
    effective: float  # how many samples the better half is worth
    path: float  # what a path forgets in a generation
    damping: float
    rank_one: float  # how fast the shape follows the path
    rank_all: float  # and the samples
    length: float  # of a standard normal vector, on average


def path_rates(dimensions: int, population: int, separable: bool = False) -> PathRates:
    """The default rates; a diagonal shape has fewer numbers to learn and learns them faster (Ros and Hansen 2008)."""
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
    """What each sample counts in the published forms, (population,), best first; they sum up to 0 (Glasmachers et al. 2010)."""
    better = np.maximum(0.0, math.log(population / 2 + 1) - np.log(np.arange(1, population + 1)))
    utilities: Array = better / better.sum() - 1.0 / population
    return utilities


def default_population(dimensions: int) -> int:
    """4 + 3 ln(dimensions), of all these strategies."""
    return 4 + int(3.0 * math.log(dimensions))
