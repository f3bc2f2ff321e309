"""When each part is sampled: its own phase within the tick, and a little jitter, as with boards of their own (thesis 2.2)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

PHASES = 0.8  # share of the tick in which the phases lie
AHEAD = 256  # ticks whose jitter is drawn at once


class Phases:
    """Seeded sampling times of the parts."""

    def __init__(self, parts: Sequence[str], jitter: float, seed: int) -> None:
        """`jitter`: standard deviation, share of a tick."""
        self._parts, self._jitter = tuple(parts), jitter
        self._rng = np.random.default_rng([seed, 0x706861])
        self._phases = self._rng.uniform(0.0, PHASES, len(parts))
        self._drawn: Iterator[list[float]] = iter(())

    def next(self) -> list[tuple[float, str]]:
        """(share of the tick, part) for one tick, in order of time; every share lies in 0..1."""
        times = next(self._drawn, None)
        if times is None:
            jitter = self._jitter * self._rng.standard_normal((AHEAD, len(self._parts)))
            self._drawn = iter(np.clip(self._phases + jitter, 0.0, 0.95).tolist())
            times = next(self._drawn)
        return sorted(zip(times, self._parts, strict=True))
