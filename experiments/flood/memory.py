"""The memory of this process over time."""

from __future__ import annotations

import os
from collections.abc import Sequence

import numpy as np

SETTLING = 0.2  # of the time, until caches and the allocator's arenas are full
SHORTEST = 60.0  # s that must be left for a slope to mean anything


def resident_mb() -> float | None:
    """Resident memory now in MB; None where the system does not say (it is read from /proc)."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            pages = int(file.read().split()[1])
    except OSError:
        return None
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6


def slope_mb_per_minute(seconds: Sequence[float], megabytes: Sequence[float]) -> float | None:
    """Slope of the straight line through the samples after the first fifth of the time; None for less than a minute of them."""
    settled = [(t / 60.0, mb) for t, mb in zip(seconds, megabytes, strict=True) if t > SETTLING * seconds[-1]]
    if not settled or (settled[-1][0] - settled[0][0]) * 60.0 < SHORTEST:
        return None
    minutes, resident = np.transpose(settled)
    return float(np.polyfit(minutes, resident, 1)[0])
