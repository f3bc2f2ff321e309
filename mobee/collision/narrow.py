"""Depth, normal and point of each pair: closed forms where there are any, python-fcl and a search for true cylinders.

Sphere and capsule against sphere, capsule and box, and box against box are exact; so is fcl on sphere and cylinder.
For the other pairs with a cylinder fcl says whether they touch, and `directions` how deep.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import fcl
import numpy as np

from mobee.collision.broad import enclosures_touch
from mobee.collision.closed_form import Overlaps, rounded_box, rounded_rounded
from mobee.collision.directions import axis_overlaps, searched_overlaps, with_points
from mobee.collision.volumes import BOX, CAPSULE, CYLINDER, SPHERE, Placed
from mobee.robot.robot import Array, Ints


def overlaps(placed: Placed, first: Ints, second: Ints) -> Overlaps:
    """Depth [m] (not positive: apart), unit normal and point of the pairs of volumes first[i], second[i]."""
    kinds = placed.volumes.kind[first], placed.volumes.kind[second]
    round_first, round_second = kinds[0] <= CAPSULE, kinds[1] <= CAPSULE
    box_first, box_second = kinds[0] == BOX, kinds[1] == BOX
    out = Overlaps(np.zeros(len(first)), np.zeros((len(first), 3)), np.zeros((len(first), 3)))
    rows = np.flatnonzero(round_first & round_second)
    if rows.size:
        _store(out, rows, _rounded(placed, first[rows], second[rows]))
    rows = np.flatnonzero(round_first & box_second)
    if rows.size:
        _store(out, rows, _with_box(placed, first[rows], second[rows]))
    rows = np.flatnonzero(box_first & round_second)
    if rows.size:
        found = _with_box(placed, second[rows], first[rows])
        _store(out, rows, Overlaps(found.depth, -found.normal, found.point))
    rows = np.flatnonzero((box_first & box_second) | (kinds[0] == CYLINDER) | (kinds[1] == CYLINDER))
    if rows.size:
        rows = rows[enclosures_touch(placed, first[rows], second[rows])]
    if rows.size:
        _edged(placed, first, second, rows, out)
    return out


def _store(out: Overlaps, rows: Ints, found: Overlaps) -> None:
    out.depth[rows], out.normal[rows], out.point[rows] = found.depth, found.normal, found.point


def _rounded(placed: Placed, a: Ints, b: Ints) -> Overlaps:
    radius = placed.volumes.radius
    return rounded_rounded((placed.center[a], placed.center[b]), (placed.core[a], placed.core[b]), (radius[a], radius[b]))


def _with_box(placed: Placed, a: Ints, box: Ints) -> Overlaps:
    where = (placed.center[box], placed.rotation[box], placed.volumes.half[box])
    return rounded_box(placed.center[a], placed.core[a], placed.volumes.radius[a], where)


def _edged(placed: Placed, first: Ints, second: Ints, rows: Ints, out: Overlaps) -> None:
    """Pairs of boxes, and pairs with a cylinder."""
    depth, direction = axis_overlaps(placed, first[rows], second[rows])
    kept = depth > 0.0
    rows, depth, direction = rows[kept], depth[kept], direction[kept]
    a, b = first[rows], second[rows]
    kind = placed.volumes.kind
    disc = (kind[a] == CYLINDER) | (kind[b] == CYLINDER)
    with_ball = disc & ((kind[a] == SPHERE) | (kind[b] == SPHERE))
    for i in np.flatnonzero(with_ball):
        depth[i], direction[i] = fcl_contact(placed, a[i], b[i])
    for i in np.flatnonzero(disc & ~with_ball):
        depth[i] *= fcl_touching(placed, a[i], b[i])
    hard = np.flatnonzero(disc & ~with_ball & (depth > 0.0))
    if hard.size:
        least, way = searched_overlaps(placed, a[hard], b[hard])
        better = least < depth[hard]
        depth[hard[better]], direction[hard[better]] = least[better], way[better]
    _store(out, rows, with_points(placed, a, b, depth, direction))


def fcl_touching(placed: Placed, first: int, second: int) -> bool:
    """Whether one pair overlaps, by python-fcl."""
    return bool(fcl.collide(_object(placed, first), _object(placed, second), fcl.CollisionRequest(), fcl.CollisionResult()))


def fcl_contact(placed: Placed, first: int, second: int) -> tuple[float, Array]:
    """Depth [m] of one pair by python-fcl (0: apart), and the way `first` must move (3,)."""
    result = fcl.CollisionResult()
    fcl.collide(_object(placed, first), _object(placed, second), fcl.CollisionRequest(enable_contact=True), result)
    if not result.contacts:
        return 0.0, np.zeros(3)
    contact = result.contacts[0]
    return contact.penetration_depth, -contact.normal  # fcl's normal points from the first to the second


def _object(placed: Placed, index: int) -> Any:
    # Made anew each time, so that no two threads ever share one; only the geometries, which never change, are kept.
    geometry = _geometry(int(placed.volumes.kind[index]), placed.volumes.size[index])
    return fcl.CollisionObject(geometry, fcl.Transform(placed.rotation[index], placed.center[index]))


@lru_cache(maxsize=4096)
def _geometry(kind: int, size: tuple[float, ...]) -> Any:
    makers = {SPHERE: fcl.Sphere, CAPSULE: fcl.Capsule, CYLINDER: fcl.Cylinder, BOX: fcl.Box}
    return makers[kind](*size)
