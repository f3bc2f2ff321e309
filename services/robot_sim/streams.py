"""When each part is sampled: its own phase within the tick, and a little jitter, as with boards of their own (thesis 2.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

PHASES = 0.8  # share of the tick in which the phases lie


class Phases:
    """Seeded sampling times of the parts."""

    def __init__(self, parts: Sequence[str], jitter: float, seed: int) -> None:
        """`jitter`: standard deviation, share of a tick."""
        self._parts, self._jitter = tuple(parts), jitter
        self._rng = np.random.default_rng([seed, 0x706861])
        self._phases = self._rng.uniform(0.0, PHASES, len(parts))

    def next(self) -> list[tuple[float, str]]:
        """(share of the tick, part) for one tick, in order of time; every share lies in 0..1."""
        times = np.clip(self._phases + self._jitter * self._rng.standard_normal(len(self._parts)), 0.0, 0.95)
        return sorted(zip(times.tolist(), self._parts, strict=True))
