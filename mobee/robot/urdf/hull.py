"""Convex hulls of meshes, exact or with few corners, and never smaller than the mesh."""

from __future__ import annotations

from typing import Literal

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.robot import Array

Corners = int | Literal["all"]  # of the hull of a mesh, at most; "all": the exact hull
CORNERS = 64
FEWEST = 8  # a hull is reduced from the box around it
THINNEST = 1e-4  # m, half the thickness that a flat mesh is given
FLAT = 1e-7  # m, the thickness below which a mesh is flat
SLIM = 1e-5  # the same, and half of what it is given, as a part of the mesh's length
MARGIN = 1e-7  # of the mesh's size, so that neither rounding nor merging leaves a point outside
NEAR = 1e-8  # of the mesh's size between corners that are one


def convex_hull(points: Array, corners: Corners = CORNERS) -> Array:
    """Vertices (v, 3) of a convex body with at most that many corners that holds all `points`, v >= 4.

    It is the exact hull where that has no more vertices, or where `corners` is "all"; else planes of the hull's facets are
    intersected, most protruding corner first, until no more corners are allowed. Flat meshes are given a thickness of 0.2 mm.
    Raises InvalidValue for points that no hull can be computed of.
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
    """The triangles (f, 3, 3) of the hull of `vertices`, corners anticlockwise as seen from outside."""
    from scipy.spatial import ConvexHull

    hull = ConvexHull(vertices)
    corners: Array = vertices[hull.simplices]
    inwards = (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) * hull.equations[:, :3]).sum(axis=1) < 0
    corners[inwards] = corners[inwards][:, ::-1]
    return corners


def _thickened(points: Array) -> Array:
    """The points; where they lie in a plane or on a line, copies of them on both sides."""
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
    """At most that many vertices of an intersection of the hull's planes (f, 4), normal and offset: n.x + d <= 0 inside."""
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
    """The points without those that repeat another up to rounding."""
    close = np.abs(points[:, None] - points).max(axis=2) <= near
    kept: Array = points[~np.tril(close, -1).any(axis=1)]
    return kept
