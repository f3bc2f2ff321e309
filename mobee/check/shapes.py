# SPDX-License-Identifier: Apache-2.0
"""Checks the shapes and the visuals of a robot.

It finds fields (volumes that cause repulsive forces) that do not enclose the solids of their link, hulls with few corners that are much
larger than the exact ones, duplicates, and mesh files of visuals (drawn surfaces) that do not exist.
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator
from itertools import combinations

import numpy as np

from mobee.arrays import Array
from mobee.check.interface import Finding, Subject, count, length, some
from mobee.robot.robot import Robot, Shape
from mobee.robot.urdf.mesh import first_file, mesh_places, searched

BALL = 96  # points on a sphere
RING = 24  # points on a circle
GRID = 7  # points along an edge of a box


def surface(shape: Shape) -> Array:
    """Return points (k, 3) m spread over the surface of a shape, root frame, zero pose; for a convex shape, its vertices."""
    return np.asarray(shape.position + _local_surface(shape) @ shape.rotation.T)


def outside(shape: Shape, points: Array) -> Array:
    """Return the distances (k,) m of `points` (k, 3) m from a shape, 0 for points inside; root frame, zero pose.

    For a convex shape (a hull) the distance is a lower bound, computed from many planes around the shape.
    """
    local = (points - shape.position) @ shape.rotation
    if shape.kind == "convex":  # beyond the nearest of many planes around it
        planes = _sphere(4 * BALL).T
        return np.asarray(np.maximum((local @ planes - (vertices(shape) @ planes).max(axis=0)).max(axis=1), 0.0))
    if shape.kind == "box":
        beyond = np.maximum(np.abs(local) - np.array(shape.size) / 2.0, 0.0)
        return np.asarray(np.linalg.norm(beyond, axis=1))
    radius, half = shape.size[0], shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
    height = np.maximum(np.abs(local[:, 2]) - half, 0.0)
    across = np.hypot(local[:, 0], local[:, 1])
    if shape.kind == "cylinder":
        return np.asarray(np.hypot(np.maximum(across - radius, 0.0), height))
    return np.asarray(np.maximum(np.hypot(across, height) - radius, 0.0))


def vertices(shape: Shape) -> Array:
    """Return the vertices (v, 3) m of a convex shape, relative to its position, along its own axes; shape (0, 3) for other shapes."""
    return np.empty((0, 3)) if shape.vertices is None else shape.vertices


def _local_surface(shape: Shape) -> Array:
    if shape.kind == "convex":
        return vertices(shape)
    if shape.kind == "box":
        steps = np.linspace(-0.5, 0.5, GRID)
        grid = np.stack(np.meshgrid(steps, steps, steps), axis=-1).reshape(-1, 3)
        return np.asarray(grid[np.abs(grid).max(axis=1) == 0.5] * np.array(shape.size))
    radius, half = shape.size[0], shape.size[1] / 2.0 if len(shape.size) > 1 else 0.0
    if shape.kind == "cylinder":
        turn = np.linspace(0.0, 2.0 * np.pi, RING, endpoint=False)
        circle = radius * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        rims = [np.column_stack([circle * share, np.full(RING, z)]) for z in (-half, half) for share in (0.5, 1.0)]
        return np.concatenate([*rims, np.column_stack([circle, np.zeros(RING)])])
    ball = radius * _sphere(BALL)
    return ball if half == 0.0 else ball + np.array([0.0, 0.0, half]) * np.where(ball[:, 2:] >= 0, 1.0, -1.0)


def _sphere(count: int) -> Array:
    """Return points spread evenly on the unit sphere (a golden spiral)."""
    k = np.arange(count) + 0.5
    z, turn = 1.0 - 2.0 * k / count, math.pi * (1.0 + math.sqrt(5.0)) * k
    across = np.sqrt(1.0 - z**2)
    return np.stack([across * np.cos(turn), across * np.sin(turn), z], axis=1)


MIN_EXCESS = 1e-3  # m: a solid that extends less beyond a field counts as enclosed
Link = tuple[list[Shape], list[Shape]]  # solids, fields


def fields(subject: Subject) -> Iterator[Finding]:
    """Yield findings about fields inside solids, solids that extend beyond all fields of their link, and links with solids but no field.

    A field is a volume around a solid that causes a repulsive force. For a robot without any field, the only finding is a note about this.
    """
    links: dict[tuple[int, str], Link] = defaultdict(lambda: ([], []))  # two robots may stand on one base
    for shape in subject.robot.shapes:
        links[shape.link, shape.part][shape.role == "field"].append(shape)
    if not any(fields for _, fields in links.values()):
        yield Finding(
            "note",
            "field",
            subject.where("robot", subject.robot.name),
            "the robot has no field",
            "no force acts before its solids touch: the controller cannot keep it away from itself or from the world",
            "`mobee convert IN OUT.xml --field 0.03` gives every solid a field that reaches 3 cm farther; keep those that you want"
            if subject.is_urdf("robot", subject.robot.name) or subject.is_mjcf
            else 'give each link that should keep its distance a field: field=".06" at a link, or a shape with field="true"',
        )
        return
    bare = list(dict.fromkeys(subject.robot.links[link] for (link, _), (solids, around) in sorted(links.items()) if solids and not around))
    if bare:
        yield Finding(
            "note",
            "field",
            subject.where("link", bare[0]),
            f"{count(bare, 'link')} with solids and without a field: {some(bare)}",
            "they can touch before any force acts, unless a neighbour's field always surrounds them",
            "nothing, if one does; else give them a field",
        )
    for _, (solids, around) in sorted(links.items()):
        yield from _check_link(subject, solids, around)


def _check_link(subject: Subject, solids: list[Shape], around: list[Shape]) -> Iterator[Finding]:
    for field in around:
        holder = next((solid for solid in solids if outside(solid, surface(field)).max() < MIN_EXCESS), None)
        if holder is not None:
            others = any(outside(other, surface(holder)).max() < MIN_EXCESS for other in around if other is not field)
            yield Finding(
                "note" if others else "warning",  # with --field a solid inside another has a field too
                "field",
                subject.where("shape", field.name),
                f"field {field.name!r} lies inside solid {holder.name!r}",
                "it can exert no force before the solid touches",
                "nothing: another field surrounds that solid" if others else "make the field larger than the solid",
            )
    if around:
        yield from _not_enclosed(subject, solids, around)


def _not_enclosed(subject: Subject, solids: list[Shape], around: list[Shape]) -> Iterator[Finding]:
    """Yield one note that lists the solids of a link that its fields (larger shapes, where forces begin to act) do not enclose.

    `around`: the fields, at least one. The solid that protrudes farthest from the fields comes first. If all are
    enclosed, nothing is yielded.
    """
    out = {solid.name: float(np.min([outside(field, surface(solid)) for field in around], axis=0).max()) for solid in solids}
    names = sorted((name for name in out if out[name] >= MIN_EXCESS), key=lambda name: -out[name])
    if names:
        yield Finding(
            "note",
            "field",
            subject.where("shape", names[0]),
            f"not enclosed by the fields of link {subject.robot.links[around[0].link]!r}: "
            f"{some(f'{name} by {length(out[name])}' for name in names)}",
            "it can touch there before any force acts",
            f"enlarge {some((field.name for field in around), 2)}, or add a field, unless that place may come near other things",
        )


SAME_WITHIN = 1e-6  # m


def identical_shapes(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each shape that is a duplicate of another one: the same link, role, kind, size, position and orientation."""
    for one, other in combinations(subject.robot.shapes, 2):
        if _same(one, other):
            yield Finding(
                "warning",
                "duplicate",
                subject.where("shape", other.name),
                f"{other.role} {other.name!r} is a duplicate of {one.name!r}: same kind, size and position",
                "each contact is counted twice, and so is its force",
                "remove one of the two",
            )


def _same(one: Shape, other: Shape) -> bool:
    if (one.link, one.role, one.kind) != (other.link, other.role, other.kind) or not np.allclose(
        one.size, other.size, rtol=0, atol=SAME_WITHIN
    ):
        return False
    if not np.allclose(one.position, other.position, rtol=0, atol=SAME_WITHIN):
        return False
    if one.kind == "convex":
        return np.array_equal(vertices(one), vertices(other))
    if one.kind == "sphere":
        return True
    if one.kind == "box":
        return np.allclose(one.rotation, other.rotation, atol=SAME_WITHIN)
    return bool(abs(one.rotation[:, 2] @ other.rotation[:, 2]) > 1 - SAME_WITHIN)  # an axis has no sign


MIN_HULL_EXCESS = 1e-4  # m: a smaller one is not reported
SUM_WEIGHT = 1e4  # of the condition that the shares sum to 1, relative to the hull's size: leaves a relative error of 1e-8


def hulls(robot: Robot, exact: Robot) -> Iterator[Finding]:
    """Yield a note if convex hulls of meshes with a reduced number of corners extend beyond the exact hulls.

    `robot`: the robot with reduced hulls. `exact`: the same robot, read with `corners="all"`.
    """
    out = {
        shape.name: excess(_root_vertices(shape), _root_vertices(true))
        for shape, true in zip(robot.shapes, exact.shapes, strict=True)
        if shape.vertices is not None and true.vertices is not None and len(shape.vertices) < len(true.vertices)
    }
    over = [name for name, far in out.items() if far > MIN_HULL_EXCESS]
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
    """Return the greatest distance [m] of one of the points `corners` (c, 3) m from the convex hull of `vertices` (v, 3) m."""
    to_vertex = np.array([np.sqrt(((vertices - corner) ** 2).sum(axis=1).min()) for corner in corners])
    farthest = 0.0
    for k in np.argsort(-to_vertex):
        if to_vertex[k] <= farthest:
            break  # none of the other corners can be farther
        farthest = max(farthest, _distance(corners[k], vertices))
    return farthest


def _distance(point: Array, vertices: Array) -> float:
    """Return the distance [m] of a point (3,) from the hull: from the nearest weighted mean of the vertices, with weights of at least 0."""
    from scipy.optimize import nnls

    around = vertices - point
    size = float(np.abs(around).max())
    shares = nnls(np.vstack([around.T, np.full(len(around), SUM_WEIGHT * size)]), np.array([0.0, 0.0, 0.0, SUM_WEIGHT * size]))[0]
    return float(np.linalg.norm(shares @ around) / shares.sum())


def _root_vertices(shape: Shape) -> Array:
    """Return the vertices (v, 3) of a convex shape in the root frame at zero pose."""
    corners: Array = np.asarray(shape.vertices) @ shape.rotation.T + shape.position
    return corners


def missing_meshes(subject: Subject) -> Iterator[Finding]:
    """Yield one finding if mesh files of the robot's visuals (its drawn surfaces) do not exist."""
    sources = dict.fromkeys(visual.mesh for visual in subject.robot.visuals if visual.mesh is not None)
    missing = [one for one in sources if first_file(mesh_places(one.file, one.robot_file)) is None]
    if missing:
        first = missing[0]
        yield Finding(
            "warning",
            "missing-meshes",
            f"{first.robot_file}:{first.line}",
            f"meshes that are drawn are missing: {some([repr(one.file) for one in missing])}",
            f"solids are shown instead, where nothing else is (looked at {searched(mesh_places(first.file, first.robot_file))})",
            "put the files there, correct their names, or name the folder of their package in ROS_PACKAGE_PATH",
        )
