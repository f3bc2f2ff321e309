"""What came of all cells, rival by rival and belief by belief."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.statistics import interquartile_mean, interval
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

BLOCK = 20  # queries, of which one point of a curve is the mean


@dataclass(frozen=True, slots=True)
class Number:
    """The interquartile mean over the seeds and its 95 % interval."""

    mean: float
    low: float
    high: float

    @classmethod
    def of(cls, values: Array) -> Number:
        """Of one value a seed, (n,)."""
        return cls(interquartile_mean(values), *interval(values))

    def __str__(self) -> str:
        digits = 1 if abs(self.mean) >= 2.0 else 2
        return f"{self.mean:.{digits}f} [{self.low:.{digits}f}, {self.high:.{digits}f}]"


@dataclass(frozen=True, slots=True, eq=False)
class Row:
    """A rival under a belief ("" for those that believe nothing)."""

    rival: str
    belief: str
    success: Number
    hard: Number
    """Success where going straight fails."""
    seconds: Number
    """Of plant time a query, the limit where there was no success."""
    actions: Number
    repairs: Number
    price: float
    """Hours of plant time, or thousands of poses looked at, before the first query."""
    curve: Array
    """(blocks, 3): seconds a query over blocks of queries, mean, low, high."""


@dataclass(frozen=True, slots=True, eq=False)
class Summary:
    """All rows, in the order of the cells."""

    rows: tuple[Row, ...]

    def row(self, rival: str, belief: str) -> Row:
        """The row of a rival; raises InvalidValue if it has not run."""
        for row in self.rows:
            if (row.rival, row.belief) == (rival, belief):
                return row
        raise InvalidValue(f"no finished cell of {rival!r} with belief {belief!r}: go on with --resume.")

    def table(self) -> list[dict[str, Any]]:
        """For the results, as text."""
        shown = ("success", "hard", "seconds", "actions", "repairs")
        return [
            {"rival": row.rival, "belief": row.belief, **{name: str(getattr(row, name)) for name in shown}, "price": round(row.price, 2)}
            for row in self.rows
        ]


def summarise(results: Iterable[CellResult]) -> Summary:
    """Put the seeds of each rival and belief together."""
    values: dict[tuple[str, str], dict[str, list[Array]]] = defaultdict(lambda: defaultdict(list))
    for result in results:
        belief = str(result.cell.settings.get("belief", ""))
        hard = result.values["hard"]
        for key, array in result.values.items():
            rival, _, measure = key.partition("|")
            if measure:
                values[rival, belief][measure].append(array)
                if measure == "success":
                    values[rival, belief]["hard"].append(array[hard])
    return Summary(tuple(_row(rival, belief, found) for (rival, belief), found in sorted(values.items())))


def _row(rival: str, belief: str, found: dict[str, list[Array]]) -> Row:
    numbers = {name: Number.of(np.array([a.mean() for a in found[name]])) for name in ("success", "hard", "seconds", "actions", "repairs")}
    seconds = found["seconds"]  # of each seed; a scene may have fewer queries than were asked for
    firsts = range(0, max(map(len, seconds)), BLOCK)
    blocks = [Number.of(np.array([one[first : first + BLOCK].mean() for one in seconds if len(one) > first])) for first in firsts]
    curve = np.array([(b.mean, b.low, b.high) for b in blocks])
    return Row(rival, belief, **numbers, price=float(np.mean(found["price"])), curve=curve)
