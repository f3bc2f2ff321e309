"""Depth, normal and point of each pair: closed forms where the field has them, python-fcl for the rest.

Sphere and capsule against sphere, capsule and box are exact (closed_form).  Box-box and everything with a true cylinder
goes to fcl: box-box is exact but for edge contacts, whose depth may exceed the smallest by 5 %; pairs with a cylinder are
iterated to about 1e-4 m.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import fcl
import numpy as np

from mobee.collision.broad import enclosures_touch
from mobee.collision.closed_form import Overlaps, rounded_box, rounded_rounded
from mobee.collision.volumes import BOX, CAPSULE, CYLINDER, SPHERE, Placed
from mobee.robot.robot import Array, Ints


def overlaps(placed: Placed, first: Ints, second: Ints) -> Overlaps:
    """Depth [m] (not positive: apart), unit normal and point of the pairs of volumes first[i], second[i]."""
    kind = placed.volumes.kind
    round_first, round_second = kind[first] <= CAPSULE, kind[second] <= CAPSULE
    box_first, box_second = kind[first] == BOX, kind[second] == BOX
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
    rows = np.flatnonzero(~((round_first | box_first) & (round_second | box_second)) | (box_first & box_second))
    for row in rows[enclosures_touch(placed, first[rows], second[rows])] if rows.size else ():
        out.depth[row], out.normal[row], out.point[row] = fcl_overlap(placed, first[row], second[row])
    return out


def _store(out: Overlaps, rows: Ints, found: Overlaps) -> None:
    out.depth[rows], out.normal[rows], out.point[rows] = found.depth, found.normal, found.point


def _rounded(placed: Placed, a: Ints, b: Ints) -> Overlaps:
    radius = placed.volumes.radius
    return rounded_rounded((placed.center[a], placed.center[b]), (placed.core[a], placed.core[b]), (radius[a], radius[b]))


def _with_box(placed: Placed, a: Ints, box: Ints) -> Overlaps:
    where = (placed.center[box], placed.rotation[box], placed.volumes.half[box])
    return rounded_box(placed.center[a], placed.core[a], placed.volumes.radius[a], where)


def fcl_overlap(placed: Placed, first: int, second: int) -> tuple[float, Array, Array]:
    """One pair by python-fcl: depth [m] (0: apart), the way `first` must move (3,), point (3,) m."""
    # The objects are made anew so that no two threads ever share one; the geometries never change.
    result = fcl.CollisionResult()
    fcl.collide(_object(placed, first), _object(placed, second), _request(), result)
    contacts = [c for c in result.contacts if c.penetration_depth > 0.0]
    if not contacts:
        return 0.0, np.zeros(3), np.zeros(3)
    deepest = max(contacts, key=lambda contact: float(contact.penetration_depth))
    # fcl's normal points from the first to the second.
    return deepest.penetration_depth, -deepest.normal, np.mean([c.pos for c in contacts], axis=0)


def _request() -> Any:
    return fcl.CollisionRequest(num_max_contacts=8, enable_contact=True)


def _object(placed: Placed, index: int) -> Any:
    geometry = _geometry(int(placed.volumes.kind[index]), placed.volumes.size[index])
    return fcl.CollisionObject(geometry, fcl.Transform(placed.rotation[index], placed.center[index]))


@lru_cache(maxsize=4096)
def _geometry(kind: int, size: tuple[float, ...]) -> Any:
    makers = {SPHERE: fcl.Sphere, CAPSULE: fcl.Capsule, CYLINDER: fcl.Cylinder, BOX: fcl.Box}
    return makers[kind](*size)
