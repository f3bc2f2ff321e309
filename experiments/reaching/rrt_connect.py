"""OMPL's RRT-Connect on what a peer believes, and shortcuts of what it finds (Kuffner and LaValle 2000; Geraerts and Overmars 2007)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.reaching.peer_belief import Care, PeerBelief
from mobee.roadmap.ompl_base import EXTENSIONS, connected
from mobee.robot.robot import Array

SHORTCUTS = 60  # tried


class _Believed:
    """A Judge by what a peer believes, within the limits that exert no force."""

    def __init__(self, belief: PeerBelief, care: Care) -> None:
        self.low, self.span, self.box = belief.range[:, 0], belief.span, belief.limits
        self._belief, self._care = belief, care

    def sound(self, q: Array) -> NDArray[np.bool_]:
        """See Judge."""
        return self._belief.sound(q, self._care)

    def sound_motion(self, start: Array, end: Array) -> bool:
        """See Judge."""
        return self._belief.sound_motion(start, end, self._care)


def rrt_connect(
    belief: PeerBelief, start: Array, ends: Array, seed: int, care: Care = "solids", extensions: int = EXTENSIONS
) -> Array | None:
    """A sound way from a sound pose (d,) to one of the poses (G, d), as its corners (k, d) rad; None: none was found.

    Raises OmplMissing.
    """
    return connected(_Believed(belief, care), start, ends, seed, extensions)


def shortened(belief: PeerBelief, path: Array, rng: np.random.Generator, care: Care = "solids") -> Array:
    """The way (k, d) with corners cut where that is sound: between points drawn on it, then from each corner as far as it goes."""
    found = _straightened(belief, list(path), care)
    for _ in range(SHORTCUTS if len(found) > 2 else 0):
        first, second = np.sort(rng.uniform(0.0, len(found) - 1, 2))
        i, j = int(first), int(second)
        if i == j:
            continue
        one, other = (found[k] + (place - k) * (found[k + 1] - found[k]) for k, place in ((i, first), (j, second)))
        if belief.sound_motion(one, other, care):
            found = [*found[: i + 1], one, other, *found[j + 1 :]]
    return np.array(_straightened(belief, found, care))


def _straightened(belief: PeerBelief, path: list[Array], care: Care) -> list[Array]:
    """Of the corners only those that are needed, greedily from the start."""
    corners, at = [path[0]], 0
    while at < len(path) - 1:
        at = next(k for k in range(len(path) - 1, at, -1) if k == at + 1 or belief.sound_motion(path[at], path[k], care))
        corners.append(path[at])
    return corners
