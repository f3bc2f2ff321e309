"""Checks how far hulls reduced to few corners extend beyond their meshes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.check.finding import Finding
from mobee.robot.robot import Robot, Shape

MIN_EXCESS = 1e-4  # m: a smaller one is not reported
SUM_WEIGHT = 1e4  # of the condition that the shares sum to 1, relative to the hull's size: leaves a relative error of 1e-8


def hulls(robot: Robot, exact: Robot) -> Iterator[Finding]:
    """Yield a note if hulls extend beyond the exact ones; `exact`: the same robot, read with `corners="all"`."""
    out = {
        shape.name: excess(_corners(shape), _corners(true))
        for shape, true in zip(robot.shapes, exact.shapes, strict=True)
        if shape.vertices is not None and true.vertices is not None and len(shape.vertices) < len(true.vertices)
    }
    over = [name for name, far in out.items() if far > MIN_EXCESS]
    if not over:
        return
    worst = max(out, key=out.__getitem__)
    most = max(len(shape.vertices) for shape in exact.shapes if shape.vertices is not None)
    subject = "the hull of one mesh extends" if len(over) == 1 else f"the hulls of {len(over)} meshes extend"
    yield Finding(
        "note",
        "reduced-hulls",
        robot.where["shape", worst],
        f"{subject} beyond the exact hull{'s' if len(over) > 1 else ''}, by {1000 * out[worst]:.2g} mm at most ({worst!r})",
        "they have fewer corners, and touch a little earlier than the exact hulls",
        f"read it with more corners (--corners N, corners=N in load_robot), or exactly (all: up to {most} corners here), which takes "
        "more time per pose",
    )


def excess(corners: Array, vertices: Array) -> float:
    """Return the greatest distance [m] of the `corners` (c, 3) from the convex hull of `vertices` (v, 3)."""
    to_vertex = np.array([np.sqrt(((vertices - corner) ** 2).sum(axis=1).min()) for corner in corners])
    farthest = 0.0
    for k in np.argsort(-to_vertex):
        if to_vertex[k] <= farthest:
            break  # none of the other corners can be farther
        farthest = max(farthest, _distance(corners[k], vertices))
    return farthest


def _distance(point: Array, vertices: Array) -> float:
    """Return the distance of a point (3,) from the hull, as that from the nearest mean of the vertices with non-negative shares."""
    from scipy.optimize import nnls

    around = vertices - point
    size = float(np.abs(around).max())
    shares = nnls(np.vstack([around.T, np.full(len(around), SUM_WEIGHT * size)]), np.array([0.0, 0.0, 0.0, SUM_WEIGHT * size]))[0]
    return float(np.linalg.norm(shares @ around) / shares.sum())


def _corners(shape: Shape) -> Array:
    """Return the vertices (v, 3) of a convex shape in the root frame at zero pose."""
    corners: Array = np.asarray(shape.vertices) @ shape.rotation.T + shape.position
    return corners
