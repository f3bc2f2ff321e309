"""Where a search may begin: what the postures about a vertex say of a place beside it."""

from __future__ import annotations

import numpy as np

from mobee.roadmap.building.chart import Chart
from mobee.robot.robot import Array

_NEAR = 2.5  # spacings
_SAME = 0.2  # of a motor's range: postures further apart are not of one kind
_DAMPING = 0.1  # spacings squared


def predicted(chart: Chart, postures: Array, vertex: int, aim: Array) -> Array:
    """A posture (d,) in [0, 1] for a place (m,), by a linear fit to the postures (V, d) of the vertex and of its like about it."""
    near, apart = chart.nearest(chart.places[vertex], 6 * chart.dimensions + 1)
    near = near[apart < _NEAR]
    near = near[(np.abs(postures[near] - postures[vertex]) < _SAME).all(axis=1)]
    middle, centre = postures[near].mean(axis=0), chart.places[near].mean(axis=0)
    ways = chart.places[near] - centre
    slope = np.linalg.solve(ways.T @ ways + _DAMPING * np.eye(len(aim)), ways.T @ (postures[near] - middle))
    found: Array = np.minimum(np.maximum(middle + (aim - centre) @ slope, 0.0), 1.0)
    return found
