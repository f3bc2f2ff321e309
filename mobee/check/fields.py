"""Checks fields: each must enclose the solids of its link, so that its force acts before they touch."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from mobee.arrays import Array
from mobee.check.finding import Finding, count, length, some
from mobee.check.subject import Subject
from mobee.robot.robot import Shape

BALL = 96  # points on a sphere
RING = 24  # points on a circle
GRID = 7  # points along an edge of a box


def surface(shape: Shape) -> Array:
    """Return points (k, 3) m on the surface of a shape, root frame, zero pose."""
    return np.asarray(shape.position + _local_surface(shape) @ shape.rotation.T)


def outside(shape: Shape, points: Array) -> Array:
    """Return the distances (k,) m of points (k, 3) m, root frame, zero pose, from a shape; 0 inside."""
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
    """Return the vertices (v, 3) m of a convex shape, in its own axes; none for other shapes."""
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
    """Find fields inside solids, solids that extend beyond all fields of their link, and links with solids but no field."""
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
            "`mobee convert IN.urdf OUT.xml --field 0.03` gives every solid a field that reaches 3 cm farther; keep those that you want"
            if subject.is_urdf
            else 'give each link that should keep its distance a field: field=".06" at a link, or a shape with field="true"',
        )
        return
    bare = [subject.robot.links[link] for (link, _), (solids, around) in sorted(links.items()) if solids and not around]
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
    """Find the solids of one link that its fields do not enclose, the worst first."""
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
