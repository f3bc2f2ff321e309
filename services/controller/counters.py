"""What the controller counts from `mark` on: ticks, those without forces or control, and how punctual its steps are."""

from __future__ import annotations

import time
from collections.abc import Mapping

from services.common.figures import Percentiles


class Counters:
    """One instance a measurement."""

    def __init__(self) -> None:
        self.ticks = self.late_forces = self.held_ticks = self.long_gaps = 0
        self._stepped_at = 0.0  # s, monotonic clock
        self._jitter = Percentiles()  # ms, of the time between two steps

    def watch_period(self, due: float) -> None:
        """Once a step: how far from due [s] after the one before it comes."""
        before, self._stepped_at = self._stepped_at, time.monotonic()
        if before > 0.0:
            self._jitter.add(abs(self._stepped_at - before - due) * 1e3)

    def numbers(self) -> Mapping[str, float]:
        """For `stat`."""
        return {
            "ticks": self.ticks,
            "late_forces": self.late_forces,
            "held_ticks": self.held_ticks,
            "long_gaps": self.long_gaps,
            "jitter_ms_p50": self._jitter.at(50),
            "jitter_ms_p99": self._jitter.at(99),
        }
