"""Running figures of a service: the last thousands of a measured time, as percentiles."""

from __future__ import annotations

from collections import deque

import numpy as np


class Percentiles:
    """The newest values of a quantity."""

    def __init__(self, keep: int = 20_000) -> None:
        self._values: deque[float] = deque(maxlen=keep)

    def add(self, value: float) -> None:
        """One more value."""
        self._values.append(value)

    def clear(self) -> None:
        """Forget all values: a measurement begins."""
        self._values.clear()

    def at(self, percent: float) -> float:
        """The percentile, or -1 when there is no value yet."""
        return float(np.percentile(self._values, percent)) if self._values else -1.0
