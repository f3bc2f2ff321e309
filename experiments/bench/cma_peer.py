"""CMA-ES by its authors (the package cma), as the strategies of the library are called: ask for a generation, tell its costs."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import MobeeError


class CmaMissing(MobeeError):
    """Raised when the benchmark is asked for and cma is not installed."""


def load_cma() -> Any:
    """The package; raises CmaMissing."""
    try:
        import cma
    except ImportError:
        raise CmaMissing("cma is not installed: pip install '.[bench]' in MoBeE's folder") from None
    return cma


class CmaStrategy:
    """A strategy with its default rates; `limits` of every coordinate, None for none."""

    def __init__(
        self, start: Array, std: float, seed: int, population: int | None = None, limits: tuple[float, float] | None = None
    ) -> None:
        options: dict[str, Any] = {"seed": seed + 1, "verbose": -9, "bounds": limits or [None, None]}  # its seed 0 is the time of day
        if population is not None:
            options["popsize"] = population
        self._strategy = load_cma().CMAEvolutionStrategy(start, std, options)
        self._asked: list[Array] = []

    def ask(self) -> Array:
        """The next generation, (population, d)."""
        self._asked = self._strategy.ask()
        return np.array(self._asked)

    def tell(self, costs: Array) -> None:
        """Follow the costs (population,) of the samples that `ask` gave."""
        self._strategy.tell(self._asked, costs.tolist())

    @property
    def stopped(self) -> bool:
        """Whether it says of itself that it has come to an end."""
        return bool(self._strategy.stop())
