"""How deep the volumes of a robot were in each other, and in the world, during a ride."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.model import Model
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True)
class Depths:
    """The deepest contacts of a ride [m], 0 where there was none."""

    solid: float
    field: float
    pair: str  # of the solids, "" where there was none


def deepest(model: Model, q: Array) -> Depths:
    """Look at the postures q (T, n) rad."""
    table = model.evaluate(q).table
    solids, fields = (np.flatnonzero(table.kind == kind) for kind in (0, 1))
    field = float(table.depth[fields].max()) if len(fields) else 0.0
    if not len(solids):
        return Depths(0.0, field, "")
    worst = solids[np.argmax(table.depth[solids])]
    pair = f"{table.name(table.first[worst])} in {table.name(table.second[worst])}"
    return Depths(float(table.depth[worst]), field, pair)


def oscillation(model: Model, q: Array, marker: str) -> float:
    """How far a marker strays at most from its mean in the postures q (T, n) rad, a straight drift taken off [m]."""
    path = model.evaluate(q).position(marker)
    time = np.linspace(-1.0, 1.0, len(path))
    drift = (time @ path) / (time @ time)
    still = path - path.mean(axis=0) - np.outer(time, drift)
    return float(np.linalg.norm(still, axis=1).max())
