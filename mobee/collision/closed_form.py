"""Exact penetration of rounded volumes (sphere, capsule) with each other and with boxes, many pairs at once.

Depth is the smallest translation that separates the pair: the Minkowski difference is a polytope (a parallelogram; a box
swept along a segment) inflated by the radii, so outside the polytope it is radii minus distance, and inside a box the
smallest overlap over the normals of the polytope's faces.  Where the deepest point is not unique (parallel capsules, a
capsule along a face, a segment inside a box) the middle of the candidates is taken, so that rounding cannot choose.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.kinematics.vectors import cross
from mobee.robot.robot import Array, Ints

_TOUCHING = 1e-10  # m: below it a distance is no direction
_PARALLEL = 1e-12  # sin^2 of the angle below which segments count as parallel


@dataclass(frozen=True, slots=True, eq=False)
class Overlaps:
    """p pairs: depth > 0 where they overlap; the first moves along the normal to separate."""

    depth: Array  # (p,) m
    normal: Array  # (p, 3) unit
    point: Array  # (p, 3) m


def rounded_rounded(centers: tuple[Array, Array], cores: tuple[Array, Array], radii: tuple[Array, Array]) -> Overlaps:
    """Spheres and capsules with spheres and capsules: centers and half segments (p, 3), radii (p,), all in m."""
    s, t = closest_parameters(centers[0] - centers[1], *cores)
    on_first = centers[0] + s[:, None] * cores[0]
    on_second = centers[1] + t[:, None] * cores[1]
    between = on_first - on_second
    distance = np.sqrt((between * between).sum(axis=1))
    normal = between / np.maximum(distance, _TOUCHING)[:, None]
    crossing = np.flatnonzero(distance < _TOUCHING)
    if crossing.size:
        normal[crossing] = _across(cores[0][crossing], cores[1][crossing])
    surfaces = on_first + on_second + normal * (radii[1] - radii[0])[:, None]
    return Overlaps(radii[0] + radii[1] - distance, normal, surfaces / 2.0)


def closest_parameters(w: Array, u: Array, v: Array) -> tuple[Array, Array]:
    """The s, t in [-1, 1] that bring w + s u and t v closest, each (p,); the middle of the span if they are parallel."""
    a, e, b = (u * u).sum(axis=1), (v * v).sum(axis=1), (u * v).sum(axis=1)
    c, f = (u * w).sum(axis=1), (v * w).sum(axis=1)
    across = a * e - b * b
    safe_a, safe_e = np.where(a > 0.0, a, 1.0), np.where(e > 0.0, e, 1.0)
    parallel = across <= _PARALLEL * a * e
    s = (b * f - c * e) / np.where(parallel, 1.0, across)
    along = parallel & (a > 0.0) & (e > 0.0)
    if along.any():
        safe_b = np.where(along, b, 1.0)
        ends = np.sort([(-e - f) / safe_b, (e - f) / safe_b], axis=0)
        s = np.where(along, (np.maximum(ends[0], -1.0) + np.minimum(ends[1], 1.0)) / 2.0, s)
    t = _unit_clip((b * _unit_clip(s) + f) / safe_e)
    return _unit_clip((b * t - c) / safe_a), t


def rounded_box(center: Array, core: Array, radius: Array, box: tuple[Array, Array, Array]) -> Overlaps:
    """Spheres and capsules with boxes: center, half segment (p, 3), radius (p,); box center, rotation, half edges."""
    box_center, box_rotation, half = box
    c = _into(box_rotation, center - box_center)
    h = _into(box_rotation, core)
    low, high = _closest_span(c, h, half)
    middle = c + ((low + high) / 2.0)[:, None] * h
    between = middle - np.clip(middle, -half, half)
    distance = np.sqrt((between * between).sum(axis=1))
    normal = between / np.maximum(distance, _TOUCHING)[:, None]
    deepest, overlap = middle, -distance
    inside = np.flatnonzero(distance < _TOUCHING)
    if inside.size:
        sink, way = _least_face(c[inside], h[inside], half[inside])
        slope = (h[inside] * way).sum(axis=1)
        flat = np.abs(slope) < 1e-9
        s = np.where(flat, (low[inside] + high[inside]) / 2.0, np.where(slope < 0.0, high[inside], low[inside]))
        deepest[inside] = c[inside] + s[:, None] * h[inside]
        normal[inside], overlap[inside] = way, sink
    point = deepest + normal * ((overlap - radius) / 2.0)[:, None]
    out_of = (box_rotation @ np.stack([normal, point], axis=-1)).transpose(2, 0, 1)
    return Overlaps(overlap + radius, out_of[0], out_of[1] + box_center)


def _closest_span(c: Array, h: Array, half: Array) -> tuple[Array, Array]:
    """The ends of the span of s in [-1, 1] over which c + s h is closest to the box: (p,) each."""
    with np.errstate(divide="ignore", invalid="ignore"):
        crossings = np.nan_to_num(np.concatenate([(half - c) / h, (-half - c) / h], axis=1), nan=1.0)
    knots = np.empty((len(c), 8))
    knots[:, 0], knots[:, 7] = -1.0, 1.0
    knots[:, 1:7] = np.sort(_unit_clip(crossings), axis=1)
    at = c[:, None, :] + knots[:, :, None] * h[:, None, :]
    beyond = at - np.clip(at, -half[:, None, :], half[:, None, :])
    # Half the derivative of the squared distance: it never falls, and is linear between knots.
    slope = (beyond * h[:, None, :]).sum(axis=2)
    noise = 1e-12 * ((h * h).sum(axis=1) + (c * c).sum(axis=1))[:, None]
    slope = np.where(np.abs(slope) < noise, 0.0, slope)
    falling, rising = (slope < 0.0).sum(axis=1), (slope > 0.0).sum(axis=1)
    return _zero_after(knots, slope, falling - 1), _zero_after(knots, slope, 7 - rising)


def _zero_after(knots: Array, slope: Array, before: Ints) -> Array:
    rows = np.arange(len(knots))
    left, right = np.clip(before, 0, 7), np.clip(before + 1, 0, 7)
    g0, g1, k0, k1 = slope[rows, left], slope[rows, right], knots[rows, left], knots[rows, right]
    # Only a sign change between the two knots needs interpolation; otherwise the zero begins or ends at a knot.
    change = (g0 < 0.0) & (g1 > 0.0)
    weight = np.where(change, g0 / np.where(change, g0 - g1, 1.0), 0.0)
    found: Array = np.where(change, k0 + weight * (k1 - k0), np.where(g0 < 0.0, k1, k0))
    return found


def _least_face(c: Array, h: Array, half: Array) -> tuple[Array, Array]:
    """How deep segments that pierce their boxes are, and the way out: (p,) m, (p, 3) unit, over the six face normals."""
    ways = np.zeros((len(c), 6, 3))
    ways[:, :3] = np.eye(3)
    edges = cross(h[:, None, :], np.eye(3))
    length = np.sqrt((edges * edges).sum(axis=2))
    usable = length > 1e-9
    ways[:, 3:] = edges / np.where(usable, length, 1.0)[:, :, None]
    offset = (ways @ c[:, :, None])[:, :, 0]
    depth = (np.abs(ways) @ half[:, :, None])[:, :, 0] + np.abs((ways @ h[:, :, None])[:, :, 0]) - np.abs(offset)
    depth[:, 3:][~usable] = np.inf
    rows, best = np.arange(len(c)), np.argmin(depth, axis=1)
    sign = np.where(offset[rows, best] < 0.0, -1.0, 1.0)
    return depth[rows, best], ways[rows, best] * sign[:, None]


def _across(u: Array, v: Array) -> Array:
    """Unit vectors perpendicular to both of two crossing segments (any such vector if they are parallel or points)."""
    normal = cross(u, v)
    for axis in np.eye(3):
        parallel = (normal * normal).sum(axis=1) <= _PARALLEL * (u * u).sum(axis=1) * (v * v).sum(axis=1)
        longer = np.where((u * u).sum(axis=1) >= (v * v).sum(axis=1), u.T, v.T).T
        normal = np.where(parallel[:, None], cross(longer, axis), normal)
    return _normalised(normal)


def _normalised(v: Array) -> Array:
    length = np.sqrt((v * v).sum(axis=1))
    up = np.array([0.0, 0.0, 1.0])  # two concentric spheres: any way out is as short
    return np.where(length[:, None] > 0.0, v / np.where(length > 0.0, length, 1.0)[:, None], up)


def _into(rotation: Array, vector: Array) -> Array:
    return (vector[:, None, :] @ rotation)[:, 0, :]


def _unit_clip(x: Array) -> Array:
    return np.minimum(np.maximum(x, -1.0), 1.0)
