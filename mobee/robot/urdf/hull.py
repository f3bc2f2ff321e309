# SPDX-License-Identifier: Apache-2.0
"""Convex hulls and bounding primitives of meshes, never smaller than the mesh."""

from __future__ import annotations

from dataclasses import dataclass
from math import pi
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import ShapeKind
from mobee.robot.xml.volume import Z, align

Corners = int | Literal["all"]  # of the hull of a mesh, at most; "all": the exact hull
CORNERS = 64
FEWEST = 8  # a hull is reduced from the box around it
THINNEST = 1e-4  # m, half the thickness that a flat mesh is given
FLAT = 1e-7  # m, the thickness below which a mesh is flat
SLIM = 1e-5  # relative to the mesh's length: the thickness below which a mesh is flat, and half the thickness that it is given
MARGIN = 1e-7  # of the mesh's size, so that neither rounding nor merging leaves a point outside
NEAR = 1e-8  # of the mesh's size between corners that are one


def convex_hull(points: Array, corners: Corners = CORNERS) -> Array:
    """Return the vertices (v, 3), v >= 4, of a convex body that contains all `points` (n, 3) m and has at most `corners` corners.

    It is the exact hull if the hull has at most `corners` corners, or if `corners` is "all". Otherwise it is a larger body: the box around
    the hull, cut by planes of the hull's facets, one after the other where the body protrudes most, until one more plane would give more
    than `corners` corners. Flat meshes get a thickness of at least 0.2 mm. Raises InvalidValue for points that have no hull.
    """
    from scipy.spatial import ConvexHull, QhullError  # 0.3 s, and only robots with meshes need it

    middle = (points.min(axis=0) + points.max(axis=0)) / 2.0  # digits are best spent near 0
    local = _thickened(points - middle)
    try:
        hull = ConvexHull(local)
        vertices = local[hull.vertices]
        if corners != "all" and len(vertices) > corners:
            vertices = _enclosing(vertices, hull.equations, corners)
    except QhullError as error:
        raise InvalidValue(f"the points have no convex hull ({str(error).splitlines()[0]})") from error
    hull_vertices: Array = vertices + middle
    return hull_vertices


def facets(vertices: Array) -> Array:
    """Return the triangles (f, 3, 3) m of the convex hull of `vertices` (v, 3) m.

    The indices are triangle, corner and coordinate; the corners of a triangle are anticlockwise as seen from outside.
    """
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    corners: Array = vertices[hull.simplices]
    inwards = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * hull.equations[:, :3]).sum(axis=1) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    return corners


def _thickened(points: Array) -> Array:
    """Return the points; for points in a plane or on a line, shifted copies on both sides."""
    for _ in range(3):
        spread = points - points.mean(axis=0)
        axes = np.linalg.svd(spread.T @ spread)[0]  # (3, 3), columns by falling extent
        thin = axes[:, 2]
        along = spread @ thin
        extent = float(np.abs(spread).max())
        if along.max() - along.min() > max(FLAT, SLIM * extent):
            return points
        half = max(THINNEST, SLIM * extent)
        points = np.vstack([points + half * thin, points - half * thin])
    return points


def _enclosing(vertices: Array, planes: Array, most: int) -> Array:
    """Return at most `most` vertices of a body that encloses the hull: some of its face planes (f, 4) intersected, n.x + d <= 0 inside."""
    from scipy.spatial import HalfspaceIntersection

    inside = vertices.mean(axis=0)
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    planes = planes - np.array([0.0, 0.0, 0.0, MARGIN * size])
    box = np.vstack([np.eye(3), -np.eye(3)])
    chosen = np.hstack([box, -(box @ vertices.T).max(axis=1, keepdims=True) - MARGIN * size])
    best = None
    while True:
        corners = _merged(HalfspaceIntersection(chosen, inside).intersections, NEAR * size)
        if best is not None and len(corners) > most:
            return best
        best = corners
        protruding = corners @ planes[:, :3].T + planes[:, 3]  # (corners, planes) m
        worst = np.unravel_index(int(protruding.argmax()), protruding.shape)
        if protruding[worst] < MARGIN * size:
            return best
        chosen = np.vstack([chosen, planes[worst[1]]])


def _merged(points: Array, near: float) -> Array:
    """Return the points without those that are equal to another up to rounding."""
    close = np.abs(points[:, None] - points).max(axis=2) <= near
    kept: Array = points[~np.tril(close, -1).any(axis=1)]
    return kept


STEPS = 400  # of the centre towards the farthest point; the radius is then right to a fraction of a percent
ROOM = 1e-9  # m, so that rounding leaves no point outside
LEAST = 1e-6  # m, the smallest edge, radius or height, for flat and thin meshes


@dataclass(frozen=True, slots=True, eq=False)
class Primitive:
    """A geometric volume with `centre` (3,) m and orientation `rotation` (3, 3).

    `kind`: "sphere", "capsule", "cylinder" or "box". `size` in m, as in `mobee.robot.robot.Shape`: sphere (radius,); capsule and cylinder
    (radius, height), without the caps of the capsule; box (x, y, z), full edges.
    """

    kind: ShapeKind
    size: tuple[float, ...]
    centre: Array
    rotation: Array

    @property
    def volume(self) -> float:
        """The volume of the primitive [m^3]."""
        match self.kind:
            case "sphere":
                return 4 / 3 * pi * self.size[0] ** 3
            case "capsule":
                return pi * self.size[0] ** 2 * (self.size[1] + 4 / 3 * self.size[0])
            case "cylinder":
                return pi * self.size[0] ** 2 * self.size[1]
            case _:
                return self.size[0] * self.size[1] * self.size[2]


def smallest(points: Array) -> Primitive:
    """Return the smallest sphere, capsule, cylinder or box, by volume, that contains all points (v, 3) m.

    Only axes along the coordinate axes and along the principal axes of the points are tried.
    """
    axes = _axes(points)
    boxes = [_box(points, frame) for frame in axes]
    round_ones = [fit(points, axis) for frame in axes for axis in frame.T for fit in (capsule_along, _cylinder)]
    return min([bounding_sphere(points), *boxes, *round_ones], key=lambda one: one.volume)


def smallest_capsule(points: Array) -> Primitive:
    """Return the smallest capsule, by volume, that contains all points (v, 3) m.

    Only axes along the coordinate axes and along the principal axes of the points are tried.
    """
    return min((capsule_along(points, axis) for frame in _axes(points) for axis in frame.T), key=lambda one: one.volume)


def bounding_sphere(points: Array) -> Primitive:
    """Return a sphere that contains all points (v, 3) m; it is a little larger than the smallest such sphere."""
    centre = _centre(points)
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    return Primitive("sphere", (max(radius, LEAST) + ROOM,), centre, np.eye(3))


def capsule_along(points: Array, axis: Array) -> Primitive:
    """Return the shortest capsule along the unit vector `axis` (3,) that contains all points (v, 3) m.

    Its radius is that of the thinnest cylinder along this axis that contains all points, computed approximately.
    """
    rotation, centre, radius, off, along = _around(points, axis)
    reach = np.sqrt(np.maximum(radius**2 - off**2, 0.0))  # how far beyond its cap's centre a point may lie
    low, high = float((along + reach).min()), float((along - reach).max())
    middle, height = (low + high) / 2.0, max(high - low, 0.0)
    if height == 0.0:  # then the point farthest from the middle determines the radius
        radius = float(np.hypot(off, along - middle).max())
    size = (max(radius, LEAST) + ROOM, max(height, LEAST))
    return Primitive("capsule", size, centre + middle * axis, rotation)


def _cylinder(points: Array, axis: Array) -> Primitive:
    rotation, centre, radius, _, along = _around(points, axis)
    low, high = float(along.min()), float(along.max())
    size = (max(radius, LEAST) + ROOM, max(high - low, LEAST) + 2 * ROOM)
    return Primitive("cylinder", size, centre + (low + high) / 2.0 * axis, rotation)


def _box(points: Array, frame: Array) -> Primitive:
    local = points @ frame
    low, high = local.min(axis=0), local.max(axis=0)
    width, height, depth = (float(edge) for edge in np.maximum(high - low, LEAST) + 2 * ROOM)
    return Primitive("box", (width, height, depth), frame @ ((low + high) / 2.0), frame)


def _around(points: Array, axis: Array) -> tuple[Array, Array, float, Array, Array]:
    """Return the thinnest cylinder along the unit vector `axis` (3,) around points (v, 3) m, computed approximately.

    The result is: a rotation (3, 3) that turns z into the axis, a point (3,) on the cylinder's axis, the radius [m], and for each point its
    distance from this axis and its position along it, (v,) m each.
    """
    rotation = align(Z, axis)
    local = points @ rotation
    middle = _centre(local[:, :2])
    off = np.linalg.norm(local[:, :2] - middle, axis=1)
    return rotation, rotation[:, :2] @ middle, float(off.max()), off, local[:, 2]


def _centre(points: Array) -> Array:
    """Return approximately the centre of the smallest ball around points of any dimension (algorithm of Badoiu and Clarkson)."""
    centre: Array = (points.min(axis=0) + points.max(axis=0)) / 2.0
    best, least = centre, float(np.linalg.norm(points - centre, axis=1).max())
    for step in range(1, STEPS):
        distances = np.linalg.norm(points - centre, axis=1)
        far = int(distances.argmax())
        if distances[far] < least:
            best, least = centre, float(distances[far])
        centre = centre + (points[far] - centre) / (step + 1)
    return best


def _axes(points: Array) -> list[Array]:
    """Return frames (3, 3), axes in columns, in which a tight fit is likely: the mesh's own, and the main axes of its points."""
    spread = points - points.mean(axis=0)
    main: Array = np.linalg.svd(spread.T @ spread)[0]
    if np.linalg.det(main) < 0:
        main = main * np.array([1.0, 1.0, -1.0])
    return [np.eye(3), main]
