"""The triangles of a convex hull, for drawing it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Array, Ints

FLAT = 1e-9  # of the hull's size: points that stand out less lie in a face


def hull_triangles(points: Array) -> Ints:
    """Corners (t, 3) of the hull's triangles, counterclockwise seen from outside; indices into `points` (v, 3).

    None, (0, 3), if all points are in a plane.
    """
    middle = points.mean(axis=0)
    tolerance = FLAT * float(np.abs(points - middle).max())
    start = _tetrahedron(points, tolerance)
    if start is None:
        return np.empty((0, 3), dtype=np.intp)
    inside = points[list(start)].mean(axis=0)
    a, b, c, d = start
    faces = _outward(points, np.array([[a, b, c], [a, b, d], [a, c, d], [b, c, d]]), inside)
    for index in range(len(points)):
        seen = _visible(points, faces, index, tolerance)
        if not seen.any():
            continue
        edges = {(int(face[k]), int(face[k - 2])) for face in faces[seen] for k in range(3)}  # k-2 is the corner after k
        rim = [edge for edge in edges if edge[::-1] not in edges]
        faces = np.concatenate([faces[~seen], np.array([[first, second, index] for first, second in sorted(rim)])])
    return faces


def _tetrahedron(points: Array, tolerance: float) -> tuple[int, int, int, int] | None:
    """Four points that are not in a plane; None when all are."""
    a = int(points[:, 0].argmin())
    b = int(np.linalg.norm(points - points[a], axis=1).argmax())
    along = points[b] - points[a]
    aside = np.linalg.norm(np.cross(points - points[a], along), axis=1)
    c = int(aside.argmax())
    above = np.abs((points - points[a]) @ np.cross(along, points[c] - points[a]))
    d = int(above.argmax())
    thick = above[d] > tolerance * max(float(np.linalg.norm(along)) * float(np.linalg.norm(points[c] - points[a])), tolerance)
    return (a, b, c, d) if thick else None


def _outward(points: Array, faces: Ints, inside: Array) -> Ints:
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    turned = ((inside - corner[:, 0]) * normal).sum(axis=1) > 0
    faces[turned] = faces[turned][:, ::-1]
    return faces


def _visible(points: Array, faces: Ints, index: int, tolerance: float) -> NDArray[np.bool_]:
    """The faces that a point lies in front of."""
    corner = points[faces]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    height = ((points[index] - corner[:, 0]) * normal).sum(axis=1)
    return np.asarray(height > tolerance * np.linalg.norm(normal, axis=1))
