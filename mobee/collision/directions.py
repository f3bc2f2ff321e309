"""Penetration of boxes and true cylinders: the direction along which the pair overlaps least.

All our volumes are symmetric about their centre, so along a unit direction d two of them overlap by
w_a(d) + w_b(d) - |c.d|, with half widths w and the line of centres c; the depth is the minimum over d.  For box-box the
minimum lies on one of 15 axes (separating axis theorem) and is exact.  With a cylinder it may also lie on a great circle
perpendicular to an axis, or where two rims meet: both are sampled and refined, to below 1e-6 m.  (The iterative EPA in
python-fcl is off by centimetres on deep cylinders, which is why it is not used for them.)
"""

from __future__ import annotations

import numpy as np

from mobee.collision.closed_form import Overlaps
from mobee.collision.volumes import BOX, CYLINDER, Placed
from mobee.kinematics.vectors import cross
from mobee.robot.robot import Array, Ints

_ALIGNED = 1e-5  # rad: a normal this close to a face's or an edge's counts as square to it
_TURN = np.linspace(0.0, np.pi, 48, endpoint=False)
_ZOOM = np.linspace(-1.0, 1.0, 17)
_PATCH = np.stack(np.meshgrid(np.linspace(-1, 1, 7), np.linspace(-1, 1, 7)), axis=-1).reshape(-1, 2)


def _spiral(count: int) -> Array:
    """Directions spread evenly over the upper half sphere (the overlap is the same for d and -d)."""
    z = (np.arange(count) + 0.5) / count
    angle = np.arange(count) * np.pi * (3.0 - np.sqrt(5.0))
    flat = np.sqrt(1.0 - z * z)
    return np.stack([flat * np.cos(angle), flat * np.sin(angle), z], axis=1)


_EVERYWHERE = _spiral(160)


def axis_overlaps(placed: Placed, first: Ints, second: Ints) -> tuple[Array, Array]:
    """The least overlap over the axes of both volumes and their cross products: (p,) m, (p, 3) unit; exact for boxes."""
    axes_a, axes_b = np.swapaxes(placed.rotation[first], 1, 2), np.swapaxes(placed.rotation[second], 1, 2)
    crossed = cross(axes_a[:, :, None, :], axes_b[:, None, :, :]).reshape(-1, 9, 3)
    length = np.sqrt((crossed * crossed).sum(axis=2, keepdims=True))
    # Nearly parallel edges span no face; their place is taken by an axis that is a candidate anyway.
    crossed = np.where(length > 1e-9, crossed / np.maximum(length, 1e-9), axes_a[:, :1])
    return _least(placed, first, second, np.concatenate([axes_a, axes_b, crossed], axis=1))


def searched_overlaps(placed: Placed, first: Ints, second: Ints) -> tuple[Array, Array]:
    """The least overlap over great circles and over all directions, refined: (p,) m, (p, 3) unit."""
    depth, direction = _least(placed, first, second, _on_circles(placed, first, second))
    # Only two curved volumes have a smooth minimum off the circles: the way out never leads over a corner or an edge.
    kind = placed.volumes.kind
    rows = np.flatnonzero((kind[first] != BOX) & (kind[second] != BOX))
    if rows.size:
        smooth, way = _anywhere(placed, first[rows], second[rows])
        better = smooth < depth[rows]
        depth[rows[better]], direction[rows[better]] = smooth[better], way[better]
    return depth, direction


def with_points(placed: Placed, first: Ints, second: Ints, depth: Array, direction: Array) -> Overlaps:
    """Turn each direction the way `first` must move, and find the point midway between the deepest points."""
    apart = placed.center[first] - placed.center[second]
    normal = np.where((apart * direction).sum(axis=1) < 0.0, -1.0, 1.0)[:, None] * direction
    on_first, spread_first = _deepest(placed, first, -normal)
    on_second, spread_second = _deepest(placed, second, normal)
    half = normal * (depth / 2.0)[:, None]
    smaller = (spread_first <= spread_second)[:, None]
    return Overlaps(depth, normal, np.where(smaller, on_first + half, on_second - half))


def _overlap(placed: Placed, first: Ints, second: Ints, directions: Array) -> Array:
    """(p, m) m, along directions (p, m, 3)."""
    apart = (directions @ (placed.center[first] - placed.center[second])[:, :, None])[:, :, 0]
    overlap: Array = _width(placed, first, directions) + _width(placed, second, directions) - np.abs(apart)
    return overlap


def _width(placed: Placed, which: Ints, directions: Array) -> Array:
    v = placed.volumes
    cosines = np.abs(directions @ placed.rotation[which])
    along: Array = (cosines @ _extent(placed, which)[:, :, None])[:, :, 0]
    disc = v.kind[which] == CYLINDER
    rim = np.hypot(cosines[:, :, 0], cosines[:, :, 1])
    return along + _round(placed, which)[:, None] * np.where(disc[:, None], rim, 1.0)


def _extent(placed: Placed, which: Ints) -> Array:
    return np.maximum(placed.volumes.half[which], placed.volumes.core[which])


def _round(placed: Placed, which: Ints) -> Array:
    return np.where(placed.volumes.half[which].any(axis=1), 0.0, placed.volumes.radius[which])


def _least(placed: Placed, first: Ints, second: Ints, directions: Array) -> tuple[Array, Array]:
    overlap = _overlap(placed, first, second, directions)
    rows, best = np.arange(len(first)), overlap.argmin(axis=1)
    return overlap[rows, best], directions[rows, best]


def _on_circles(placed: Placed, first: Ints, second: Ints) -> Array:
    """The best direction perpendicular to each of the six axes: (p, 6, 3)."""
    frames = np.concatenate([np.swapaxes(placed.rotation[which], 1, 2) for which in (first, second)], axis=1)
    u, v = frames[:, [1, 2, 0, 4, 5, 3]], frames[:, [2, 0, 1, 5, 3, 4]]
    angle = np.zeros((len(first), 6, 1))
    offsets, step = _TURN, _TURN[1]
    for _ in range(6):
        tried = angle + offsets
        ways = np.cos(tried)[..., None] * u[:, :, None, :] + np.sin(tried)[..., None] * v[:, :, None, :]
        overlap = _overlap(placed, first, second, ways.reshape(len(first), -1, 3)).reshape(tried.shape)
        best = overlap.argmin(axis=2)[:, :, None]
        angle = np.take_along_axis(tried, best, axis=2)
        offsets, step = step * _ZOOM, step / 8.0
    found: Array = np.cos(angle) * u + np.sin(angle) * v
    return found


def _anywhere(placed: Placed, first: Ints, second: Ints) -> tuple[Array, Array]:
    """The least overlap and its direction among all, where the overlap is smooth: (p,) m, (p, 3)."""
    step = 0.2
    depth, center = _least(placed, first, second, np.broadcast_to(_EVERYWHERE, (len(first), *_EVERYWHERE.shape)))
    for _ in range(8):
        u = cross(center, np.eye(3)[np.abs(center).argmin(axis=1)])
        u /= np.sqrt((u * u).sum(axis=1, keepdims=True))
        v = cross(center, u)
        near = center[:, None] + step * (_PATCH[:, :1] * u[:, None] + _PATCH[:, 1:] * v[:, None])
        near /= np.sqrt((near * near).sum(axis=2, keepdims=True))
        depth, center = _least(placed, first, second, near)
        step /= 2.5
    return depth, center


def _deepest(placed: Placed, which: Ints, direction: Array) -> tuple[Array, Array]:
    """The middle of the face, edge or corner that lies farthest along the direction: (p, 3) m, and its extent (p,) m."""
    v = placed.volumes
    local = (direction[:, None, :] @ placed.rotation[which])[:, 0]
    extent = _extent(placed, which)
    flat = np.abs(local) < _ALIGNED
    point = np.where(flat, 0.0, np.sign(local)) * extent
    spread = np.where(flat, extent, 0.0).sum(axis=1)
    disc = v.kind[which] == CYLINDER
    across = np.where(disc[:, None], local * [1.0, 1.0, 0.0], local)
    length = np.sqrt((across * across).sum(axis=1))
    cap = disc & (length < _ALIGNED)
    reach = np.where(cap, 0.0, _round(placed, which) / np.maximum(length, _ALIGNED))
    point += reach[:, None] * across
    spread += np.where(cap, v.radius[which], 0.0)
    return (placed.rotation[which] @ point[:, :, None])[:, :, 0] + placed.center[which], spread
