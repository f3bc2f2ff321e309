"""Spheres and capsules with each other: a point or a segment each, inflated by a radius."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine.compiled import inlined, inner
from mobee.engine.narrow.slots import (
    CENTER,
    CORE,
    RADIUS,
    TOUCHING,
    TWO,
    Offset,
    Vector,
    centers_apart,
    own_axis,
    store,
    unit,
    vector,
)
from mobee.robot.robot import Array

_PARALLEL = 1e-12  # sin^2 of the angle below which segments count as parallel
_SHORT = 1e-24  # m^2: the square of a half length below which a capsule counts as a sphere
_X, _Z = np.uint64(0), TWO


@inner
def sphere_sphere(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    squared = x * x + y * y + z * z
    reach = P[i + RADIUS] + P[j + RADIUS]
    if squared >= reach * reach:
        return reach - math.sqrt(squared)
    distance = math.sqrt(squared)
    if distance < TOUCHING:
        _store(P, i, j, own_axis(P, i, _Z), 0.0, 0.0, out)
    else:
        _store(P, i, j, (x / distance, y / distance, z / distance), 0.0, 0.0, out)
    return reach - distance


@inner
def sphere_capsule(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    vx, vy, vz = vector(P, j + CORE)
    t = unit((vx * x + vy * y + vz * z) / max(vx * vx + vy * vy + vz * vz, _SHORT))
    x, y, z = x - t * vx, y - t * vy, z - t * vz
    squared = x * x + y * y + z * z
    reach = P[i + RADIUS] + P[j + RADIUS]
    if squared >= reach * reach:
        return reach - math.sqrt(squared)
    distance = math.sqrt(squared)
    if distance < TOUCHING:
        _store(P, i, j, own_axis(P, j, _X), 0.0, t, out)
    else:
        _store(P, i, j, (x / distance, y / distance, z / distance), 0.0, t, out)
    return reach - distance


@inner
def capsule_capsule(P: Array, a: int, b: int, out: Array) -> float:
    """See `overlap`."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    ux, uy, uz = vector(P, i + CORE)
    vx, vy, vz = vector(P, j + CORE)
    s, t = closest_parameters(x, y, z, ux, uy, uz, vx, vy, vz)
    x, y, z = x + s * ux - t * vx, y + s * uy - t * vy, z + s * uz - t * vz
    squared = x * x + y * y + z * z
    reach = P[i + RADIUS] + P[j + RADIUS]
    if squared >= reach * reach:
        return reach - math.sqrt(squared)
    distance = math.sqrt(squared)
    if distance < TOUCHING:
        _store(P, i, j, _across(P, i, j), s, t, out)
    else:
        _store(P, i, j, (x / distance, y / distance, z / distance), s, t, out)
    return reach - distance


@inlined
def closest_parameters(
    x: float, y: float, z: float, ux: float, uy: float, uz: float, vx: float, vy: float, vz: float
) -> tuple[float, float]:
    """The s, t in [-1, 1] that bring w + s u and t v closest, w = (x, y, z); the middle of the span if they are parallel."""
    a, e, b = ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, ux * vx + uy * vy + uz * vz
    c, f = ux * x + uy * y + uz * z, vx * x + vy * y + vz * z
    across, both = a * e - b * b, a * e
    if across > _PARALLEL * both:
        s = unit((b * f - c * e) / across)
    elif a > _SHORT and e > _SHORT:
        # The ends of v, measured along u.
        first, last = (-e - f) / b, (e - f) / b
        s = (max(min(first, last), -1.0) + min(max(first, last), 1.0)) / 2.0
    else:
        s = 0.0
    t = unit((b * unit(s) + f) / max(e, _SHORT))
    return unit((b * t - c) / max(a, _SHORT)), t


@inlined
def _store(P: Array, i: Offset, j: Offset, normal: Vector, s: float, t: float, out: Array) -> None:
    """Write the contact of two rounded volumes whose cores come closest at s and t."""
    ax, ay, az = vector(P, i + CENTER)
    bx, by, bz = vector(P, j + CENTER)
    ux, uy, uz = vector(P, i + CORE)
    vx, vy, vz = vector(P, j + CORE)
    more = P[j + RADIUS] - P[i + RADIUS]
    x = (ax + s * ux + bx + t * vx + more * normal[0]) / 2.0
    y = (ay + s * uy + by + t * vy + more * normal[1]) / 2.0
    z = (az + s * uz + bz + t * vz + more * normal[2]) / 2.0
    store(out, normal, (x, y, z))


@inlined
def _across(P: Array, i: Offset, j: Offset) -> Vector:
    """A unit vector perpendicular to both of two crossing segments (along one line: the longer one's own x axis)."""
    ux, uy, uz = vector(P, i + CORE)
    vx, vy, vz = vector(P, j + CORE)
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    squared, a, e = x * x + y * y + z * z, ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz
    if squared <= max(_PARALLEL * a * e, _SHORT * _SHORT):
        return own_axis(P, i if a >= e else j, _X)
    length = math.sqrt(squared)
    return x / length, y / length, z / length
