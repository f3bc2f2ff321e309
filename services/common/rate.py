# SPDX-License-Identifier: Apache-2.0
"""A fixed rate by absolute deadlines, and percentiles of measured times."""

from __future__ import annotations

import time
from array import array

import numpy as np

NOT_MEASURED = -1.0  # value of a number in the status of a service; on the bus it is None


class Rate:
    """Deadlines that are `period` [s] apart, on the monotonic clock.

    After a delay of more than a period, whole periods are skipped and counted in `missed`.
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.deadline = time.monotonic() + period
        self.missed = 0  # ticks that were skipped

    def next(self) -> float:
        """Return the next deadline, s on the monotonic clock; call this once per tick, after the work of the tick."""
        late = time.monotonic() - self.deadline
        if late > self.period:
            skipped = int(late / self.period)
            self.missed += skipped
            self.deadline += skipped * self.period
        current = self.deadline
        self.deadline += self.period
        return current


class Percentiles:
    """Percentiles of the newest `keep` values of a quantity. The memory is constant."""

    def __init__(self, keep: int = 20_000) -> None:
        self._values, self._count = array("d", [0.0]) * keep, 0

    def add(self, value: float) -> None:
        """Add a value."""
        self._values[self._count % len(self._values)] = value
        self._count += 1

    def clear(self) -> None:
        """Drop all values, at the start of a measurement."""
        self._count = 0

    def at(self, percent: float) -> float:
        """Return the value below which `percent` % of the stored values lie; NOT_MEASURED (-1) if there is no value yet."""
        return float(np.percentile(np.frombuffer(self._values)[: self._count], percent)) if self._count else NOT_MEASURED
