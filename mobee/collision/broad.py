"""Which pairs may touch: bounding spheres for all, then tighter enclosures for those that need the iterative test."""

from __future__ import annotations

import numpy as np

from mobee.collision.closed_form import closest_parameters
from mobee.collision.volumes import BOX, Placed
from mobee.robot.robot import Array, Ints


def near_pairs(placed: Placed, pairs: Ints) -> Ints:
    """Indices of the rows of `pairs` (p, 2) whose bounding spheres overlap."""
    between = placed.center[pairs[:, 0]] - placed.center[pairs[:, 1]]
    reach = placed.volumes.bound[pairs[:, 0]] + placed.volumes.bound[pairs[:, 1]]
    return np.flatnonzero((between * between).sum(axis=1) < reach * reach)


def near_grid(placed: Placed, rows: int, allowed: Array) -> tuple[Ints, Ints]:
    """Pairs (row, column + rows) of the first `rows` volumes with the rest that may touch; `allowed` is their (rows, rest) mask."""
    a, b = placed.center[:rows], placed.center[rows:]
    reach = placed.volumes.bound[:rows, None] + placed.volumes.bound[rows:]
    squared = (a * a).sum(axis=1)[:, None] + (b * b).sum(axis=1) - 2.0 * (a @ b.T)
    first, second = np.nonzero(allowed & (squared < reach * reach + 1e-9))
    return first, second + rows


def enclosures_touch(placed: Placed, first: Ints, second: Ints) -> Array:
    """For each pair: False if enclosing capsules, or a box and what surrounds the other, show that it is apart."""
    v = placed.volumes
    s, t = closest_parameters(placed.center[first] - placed.center[second], placed.core[first], placed.core[second])
    between = placed.center[first] + s[:, None] * placed.core[first] - placed.center[second] - t[:, None] * placed.core[second]
    reach = v.radius[first] + v.radius[second]
    touch: Array = (between * between).sum(axis=1) < reach * reach
    for boxes, others in ((first, second), (second, first)):
        rows = np.flatnonzero(touch & (v.kind[boxes] == BOX))
        if rows.size:
            touch[rows] = _gap_to_box(placed, boxes[rows], others[rows]) < v.radius[others[rows]]
    return touch


def _gap_to_box(placed: Placed, boxes: Ints, others: Ints) -> Array:
    """A lower bound of the distance between a box and the other's core segment: in the box's frame, to the segment's own box."""
    axes = placed.rotation[boxes]
    offset = ((placed.center[others] - placed.center[boxes])[:, None, :] @ axes)[:, 0]
    extent = np.abs((placed.core[others][:, None, :] @ axes)[:, 0])
    gap = np.maximum(np.abs(offset) - extent - placed.volumes.half[boxes], 0.0)
    distance: Array = np.sqrt((gap * gap).sum(axis=1))
    return distance
