"""Which reaches tell most: from above, far, around the target."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.robot.robot import Array

LAST = 0.10  # m of the way, from its end: whether it is from above
LEAST = 0.15  # m: the shortest way that is shown


def selected(ways: Sequence[Array]) -> dict[str, int]:
    """Which of the ways (T, 3) m tells most of each kind, no way for two."""
    left = [number for number, way in enumerate(ways) if _length(way) >= LEAST]
    chosen: dict[str, int] = {}
    for name, much in KINDS.items():
        if left:
            chosen[name] = left.pop(int(np.argmax([much(ways[number]) for number in left])))
    return chosen


def _length(way: Array) -> float:
    return float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())


def _descent(way: Array) -> float:
    """How steeply the last piece of the way goes down: 1 straight, 0 level."""
    before = way[np.linalg.norm(way - way[-1], axis=1) >= LAST]
    if not len(before):
        return -np.inf
    return float((before[-1] - way[-1])[2] / np.linalg.norm(before[-1] - way[-1]))


def _distance(way: Array) -> float:
    return float(np.linalg.norm(way[-1] - way[0]))


def _detour(way: Array) -> float:
    """How many times as long as straight."""
    return _length(way) / max(float(np.linalg.norm(way[-1] - way[0])), LAST)


KINDS = {"From above": _descent, "Far": _distance, "Around the target": _detour}
