"""Several searches by evolution at once, each as `NES`: their generations are drawn, judged and followed together."""

from __future__ import annotations

import math

import numpy as np

from mobee.roadmap.evolution.rates import path_rates
from mobee.robot.robot import Array, Ints

_NEGLIGIBLE = 1e-12


class Searches:
    """Search distributions (L of them) over d coordinates; the arrays are all there is to them.

    `mean` (L, d), `sigma` (L,), `shape` (L, d, d), `path` (L, d), `age` (L,) generations since they began.
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
        """Begin a search anew, from a mean (d,) with the same standard deviation everywhere."""
        self.mean[number], self.sigma[number], self.age[number] = mean, std, 0
        self.shape[number], self.path[number] = np.eye(len(mean)), 0.0

    def ask(self, which: Ints, z: Array) -> Array:
        """The samples (k, population, d) of some searches (k,), from standard normal ones z of the same shape."""
        samples: Array = self.mean[which, None] + self.sigma[which, None, None] * (z @ self.shape[which].transpose(0, 2, 1))
        return samples

    def tell(self, which: Ints, z: Array, costs: Array) -> None:
        """Let the searches (k,) follow the costs (k, population) of what they asked for, see `NES.tell`."""
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
    """(exp(a) - 1) / a of matrices (k, d, d) by Taylor's series, see `shapes`."""
    norm, size, power = math.sqrt(float((a * a).sum(axis=(1, 2)).max())), 1.0, 1
    term = np.broadcast_to(np.eye(a.shape[-1]), a.shape)
    total = term.copy()
    while size > _NEGLIGIBLE:
        power += 1
        size *= norm / power
        term = term @ a / power
        total += term
    return total
