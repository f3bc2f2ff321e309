"""How far a sweep is, and how long it will take."""

from __future__ import annotations

from collections.abc import Sequence


class TimeLeft:
    """Counts costs of cells: `everything` there is, `left` at the moment `start` [s]."""

    def __init__(self, everything: Sequence[float], left: Sequence[float], start: float) -> None:
        self._all, self._left, self._start = sum(everything), sum(left), start
        self._done, self._now = 0.0, start

    def finished(self, cost: float, now: float) -> None:
        """One more cell is done, now [s]."""
        self._done, self._now = self._done + cost, now

    @property
    def fraction(self) -> float:
        """Of all costs, those of earlier runs too."""
        return 1.0 - (self._left - self._done) / self._all if self._all else 1.0

    @property
    def seconds(self) -> float:
        """At the pace so far."""
        return (self._left - self._done) * (self._now - self._start) / self._done if self._done else float("inf")

    def __str__(self) -> str:
        left = round(self.seconds)
        if left < 60:
            return f"{left} s left"
        return f"{left // 60} min left" if left < 3600 else f"{left // 3600} h {left % 3600 // 60:02d} min left"
