"""One way to keep a rate: absolute deadlines, and a late tick is skipped and counted, never caught up."""

from __future__ import annotations

import time


class Rate:
    """Deadlines `period` seconds apart on the monotonic clock."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.deadline = time.monotonic() + period
        self.missed = 0  # ticks that were skipped

    def next(self) -> float:
        """The deadline to wait for; call once a tick, after the tick's work."""
        late = time.monotonic() - self.deadline
        if late > self.period:
            skipped = int(late / self.period)
            self.missed += skipped
            self.deadline += skipped * self.period
        current = self.deadline
        self.deadline += self.period
        return current
