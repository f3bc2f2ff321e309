"""A segment c + s h, |s| <= 1, and a box about the origin: how close they come, and where."""

from __future__ import annotations

import math

from mobee.engine.compiled import inlined
from mobee.engine.narrow.slots import FLAT, Vector, unit

Spans = tuple[float, float, float, float, float, float]
Ends = tuple[float, float, float, float]

_FAR = 2.0  # a parameter beyond every segment's end


@inlined
def closest_to_box(x: float, y: float, z: float, hx: float, hy: float, hz: float, kx: float, ky: float, kz: float) -> float:
    """The s in [-1, 1] that brings c + s h closest to the box of half edges k, c = (x, y, z): the middle of all such s."""
    least = FLAT * FLAT * (hx * hx + hy * hy + hz * hz)
    x0, x1 = span_within(x, hx, kx, least)
    y0, y1 = span_within(y, hy, ky, least)
    z0, z1 = span_within(z, hz, kz, least)
    low, high = max(x0, y0, z0, -1.0), min(x1, y1, z1, 1.0)
    if low <= high:
        return (low + high) / 2.0
    # Half the derivative of the squared distance never falls, and is linear between these knots; its zero is here unique.
    spans, weights = (x0, x1, y0, y1, z0, z1), (hx * hx, hy * hy, hz * hz)
    ends = _between(-1.0, spans, weights, (-1.0, -1.0, 1.0, 1.0))
    ends = _between(unit(x0), spans, weights, ends)
    ends = _between(unit(x1), spans, weights, ends)
    ends = _between(unit(y0), spans, weights, ends)
    ends = _between(unit(y1), spans, weights, ends)
    ends = _between(unit(z0), spans, weights, ends)
    ends = _between(unit(z1), spans, weights, ends)
    left, under, right, over = _between(1.0, spans, weights, ends)
    if left >= right:
        return right
    return left + (right - left) * (under / (under - over))


@inlined
def _between(s: float, spans: Spans, weights: Vector, ends: Ends) -> Ends:
    """The ends of the part where the derivative changes sign, with its values there, drawn in to the knot s if it is nearer."""
    x0, x1, y0, y1, z0, z1 = spans
    left, under, right, over = ends
    slope = weights[0] * _outer(s, x0, x1) + weights[1] * _outer(s, y0, y1) + weights[2] * _outer(s, z0, z1)
    if slope <= 0.0 and s >= left:
        left, under = s, slope
    if slope >= 0.0 and s <= right:
        right, over = s, slope
    return left, under, right, over


@inlined
def distance_bound(x: float, y: float, z: float, hx: float, hy: float, hz: float, kx: float, ky: float, kz: float) -> float:
    """A lower bound of the distance of the core from the box: along the box's axes, and across the core and one of them."""
    ax, ay, az = abs(hx), abs(hy), abs(hz)
    dx, dy, dz = max(abs(x) - ax - kx, 0.0), max(abs(y) - ay - ky, 0.0), max(abs(z) - az - kz, 0.0)
    squared = dx * dx + dy * dy + dz * dz
    gap, length = max(abs(y * hz - z * hy) - ky * az - kz * ay, 0.0), ay * ay + az * az
    if gap * gap > squared * length:
        squared = gap * gap / length
    gap, length = max(abs(z * hx - x * hz) - kz * ax - kx * az, 0.0), az * az + ax * ax
    if gap * gap > squared * length:
        squared = gap * gap / length
    gap, length = max(abs(x * hy - y * hx) - kx * ay - ky * ax, 0.0), ax * ax + ay * ay
    if gap * gap > squared * length:
        squared = gap * gap / length
    return math.sqrt(squared)


@inlined
def span_within(x: float, h: float, k: float, least: float) -> tuple[float, float]:
    """Between which s the coordinate x + s h is within [-k, k]; all if the line is parallel to these faces."""
    if h * h <= least:
        return -_FAR, _FAR
    middle, reach = -x / h, abs(k / h)
    return middle - reach, middle + reach


@inlined
def _outer(s: float, low: float, high: float) -> float:
    return max(s - high, 0.0) - max(low - s, 0.0)
