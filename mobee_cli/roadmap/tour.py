"""A tour of a roadmap: a motion over its edges between places far apart."""

from __future__ import annotations

import numpy as np

from mobee.control.gains import Gains
from mobee.roadmap.playback import timed
from mobee.roadmap.roadmap import Roadmap
from services.monitor.view import RATE, Stretch

PLACES = 8


def tour(trm: Roadmap, places: int = PLACES) -> list[Stretch]:
    """One stretch a way, in the largest part of the map; from the place in its middle."""
    inside = np.flatnonzero(trm.graph.components == 0)
    y = trm.y[inside] / trm.spacing
    apart = np.linalg.norm(y - y.mean(axis=0), axis=1)
    chosen = [int(apart.argmin())]
    nearest = np.linalg.norm(y - y[chosen[0]], axis=1)
    while len(chosen) < min(places, len(inside)):
        chosen.append(int(nearest.argmax()))
        nearest = np.minimum(nearest, np.linalg.norm(y - y[chosen[-1]], axis=1))
    stretches = []
    for start, goal in zip(inside[chosen], inside[chosen[1:]], strict=False):
        way = trm.graph.shortest(int(start), int(goal))
        motion = timed(trm.model.robot, trm.q[way], Gains.default(), dt=1.0 / RATE)
        stretches.append(Stretch(f"to {trm.told(trm.y[goal])}", motion.q))
    return stretches or [Stretch("the only pose", trm.q[inside[:1]])]
