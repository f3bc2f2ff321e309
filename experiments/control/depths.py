"""How deep the volumes of a robot were in each other, and in the world, during a ride."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from experiments.control.listed import is_listed
from experiments.control.ride import Ride
from mobee.model import Model
from mobee.robot.robot import Array

SECOND = 1.0  # s; a contact that oscillates does so twice a second or faster


@dataclass(frozen=True, slots=True)
class Depths:
    """The deepest contacts of a ride [m], 0 where there was none."""

    solid: float  # of those that count, see `is_listed`
    field: float
    pair: str  # of these solids, "" where there was none
    beside: float  # of solids that do not count: an upper arm beside the pelvis


def deepest(model: Model, q: Array) -> Depths:
    """Look at the postures q (T, n) rad."""
    table = model.evaluate(q).table
    depth = {True: 0.0, False: 0.0}
    pair = ""
    for row in np.flatnonzero(table.kind == 0):
        first, second = table.name(table.first[row]), table.name(table.second[row])
        counts, deep = is_listed(first, second), float(table.depth[row])
        if deep > depth[counts]:
            depth[counts] = deep
            pair = f"{first} in {second}" if counts else pair
    fields = table.depth[table.kind == 1]
    return Depths(depth[True], float(fields.max(initial=0.0)), pair, depth[False])


def oscillation(model: Model, done: Ride, marker: str) -> float:
    """How far a marker strays at most from its mean over the second around it [m]: creeping is not oscillating."""
    path = model.evaluate(done.q).position(marker)
    window = min(len(path), round(SECOND / done.dt))
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(path, axis=0)])
    mean = (total[window:] - total[:-window]) / window
    middle = path[window // 2 : window // 2 + len(mean)]
    return float(np.linalg.norm(middle - mean, axis=1).max())
