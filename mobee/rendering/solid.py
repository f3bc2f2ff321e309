# SPDX-License-Identifier: Apache-2.0
"""Coloured volumes and meshes that a picture shows, and functions that make them from a world or a path."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import CONVEX, KINDS, SURFACE
from mobee.arrays import Array
from mobee.model.world_object import WorldObject
from mobee.rendering import palette
from mobee.rendering.mesh import Mesh
from mobee.robot.robot import ShapeKind
from mobee.robot.urdf.hull import facets

Color = tuple[float, float, float]  # red, green, blue in 0..1
SolidKind = ShapeKind | Literal["mesh"]

TRAIL_RADIUS, TIP_RADIUS = 0.005, 0.009  # m
SHORTEST_PIECE = 0.006  # m, of a trail
OLD, NEW = np.array([1.0, 0.90, 0.55]), np.array([0.96, 0.62, 0.0])  # colours of a trail
TRAIL_VEIL = 0.35
GHOST_OPACITY = 0.35
TRAIL_GROUP, FIRST_OBJECT_GROUP = -2, 1000


@dataclass(frozen=True, slots=True, eq=False)
class Solid:
    """A coloured convex volume or mesh of a picture.

    Attributes:
        kind: "sphere", "box", "cylinder", "capsule", "convex" or "mesh".
        size: m, depends on the kind: sphere (radius,); capsule and cylinder (radius, height); box (x, y, z), full edges; convex and mesh
            ().
        position: (3,) m, root frame.
        rotation: (3, 3), root frame.
        color: red, green, blue, 0 to 1.
        opacity: below 1 the volume is transparent.
        veiled: share of its colour, 0 to 1, that remains visible where opaque volumes are in front of it; 0: it is hidden there.
        group: there is no outline between solids of the same group.
        vertices: (V, 3) m, corners for "convex", in the solid's frame (`position`, `rotation`).
        aside: whether it may lie outside of the picture's frame.
        mesh: the triangles, for "mesh".
    """

    kind: SolidKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    color: Color
    opacity: float = 1.0
    veiled: float = 0.0
    group: int = 0
    vertices: Array | None = None
    aside: bool = False
    mesh: Mesh | None = None

    def extent(self, along: Array) -> float:
        """Return the distance [m] from the solid's position to its farthest point along a unit vector (3,), root frame."""
        x, y, z = along @ self.rotation
        if self.kind == "sphere":
            return self.size[0]
        if self.kind == "box":
            return 0.5 * float(np.abs(np.array([x, y, z])) @ np.array(self.size))
        if self.kind == "mesh":
            assert self.mesh is not None
            return float((self.mesh.corners @ np.array([x, y, z])).max())
        if self.kind == "convex":
            assert self.vertices is not None
            return float((self.vertices @ np.array([x, y, z])).max())
        radius, height = self.size
        return radius * (1.0 if self.kind == "capsule" else float(np.hypot(x, y))) + 0.5 * height * abs(float(z))


def ball(position: Array, radius: float, color: Color, veiled: float = 0.0, group: int = 0) -> Solid:
    """Return a sphere at a position (3,) m, root frame, with a radius [m].

    `color`: red, green, blue, 0 to 1. `veiled`: share of its colour, 0 to 1, that remains visible where opaque volumes are in front of
    it; 0: it is hidden there. `group`: solids of the same group have no outline between them.
    """
    return Solid("sphere", (radius,), position, np.eye(3), color, veiled=veiled, group=group)


def tube(points: Array, radius: float, colors: Sequence[Color], veiled: float = 0.0, group: int = 0) -> list[Solid]:
    """Return a tube of capsules along the line through points (P, 3) m, root frame, with a radius [m].

    `colors`: colours of the P - 1 pieces. `veiled`: share of the colour, 0 to 1, that remains visible where opaque volumes are in front of
    the tube; 0: it is hidden there. `group`: solids of the same group have no outline between them.
    """
    pieces = []
    for start, end, color in zip(points[:-1], points[1:], colors, strict=True):
        length = float(np.linalg.norm(end - start))
        rotation = _rotation_with_z((end - start) / length) if length > 0.0 else np.eye(3)
        pieces.append(Solid("capsule", (radius, length), 0.5 * (start + end), rotation, color, veiled=veiled, group=group))
    return pieces


def object_solids(objects: Mapping[str, WorldObject]) -> list[Solid]:
    """Return world objects, given by name, as solids in their own colours or those of their roles.

    Objects with the role "ghost" (without contacts, only drawn) are transparent.
    """
    found = []
    for number, item in enumerate(objects.values()):
        red, green, blue, given = (channel / 255.0 for channel in palette.of_object(item.kind, item.role, item.color))
        opacity = min(given, GHOST_OPACITY) if item.role == "ghost" else given
        frame, aside = (item.position, item.rotation), item.role != "target"
        group = FIRST_OBJECT_GROUP + number
        found.append(Solid(item.kind, item.size, *frame, (red, green, blue), opacity, group=group, aside=aside))
    return found


def trail_solids(points: Array, group: int = TRAIL_GROUP) -> list[Solid]:
    """Return the path of a marker as solids: a line that is brighter towards its end, and a ball at the end.

    `points`: (P, 3) m, root frame, positions of the marker. `group`: number that the solids get as `Solid.group`.
    """
    path = _thinned(points)
    shares = np.linspace(0.0, 1.0, max(len(path) - 1, 1))[:, None]
    colors = [(float(r), float(g), float(b)) for r, g, b in (1.0 - shares) * OLD + shares * NEW]
    line = tube(path, TRAIL_RADIUS, colors[: len(path) - 1], TRAIL_VEIL, group)
    return [*line, ball(path[-1], TIP_RADIUS, colors[-1], TRAIL_VEIL, group)]


def focus(solids: Sequence[Solid]) -> list[Solid]:
    """Return the solids that must lie inside a picture's frame: all solids except those of world objects that are not targets."""
    return [solid for solid in solids if not solid.aside]


def lowest(solids: Sequence[Solid]) -> float:
    """Return the height [m] of the lowest point of the solids, at which the floor is drawn."""
    down = np.array([0.0, 0.0, -1.0])
    return min(float(solid.position[2]) - solid.extent(down) for solid in solids)


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """Solids in the form that the compiled core reads.

    `volumes`: (N,) structured array (dtype CONVEX) of the volumes. `surfaces`: (M,) structured array (dtype SURFACE) of the meshes.
    `numbers`: for each of these N + M volumes and meshes, volumes first, its index in the list of solids that was packed. `kept`: arrays
    to which pointers in `volumes` refer; keep them as long as `volumes` is used. Pointers in `surfaces` refer to arrays of the solids'
    meshes.
    """

    volumes: NDArray[np.void]
    surfaces: NDArray[np.void]
    numbers: list[int]
    kept: list[Array]


def packed(solids: Sequence[Solid]) -> Packed:
    """Convert solids to the form that the compiled core reads."""
    convex = [number for number, solid in enumerate(solids) if solid.mesh is None]
    others = [number for number, solid in enumerate(solids) if solid.mesh is not None]
    volumes, kept = _packed_volumes([solids[number] for number in convex])
    surfaces = np.zeros(len(others), SURFACE)
    for place, (row, number) in enumerate(zip(surfaces, others, strict=True), start=len(convex)):
        solid = solids[number]
        assert solid.mesh is not None
        row["center"], row["rotation"], row["number"] = solid.position, solid.rotation, place
        row["middle"], row["bound"] = solid.mesh.middle, solid.mesh.radius
        row["corners"], row["normals"] = solid.mesh.corners.ctypes.data, solid.mesh.normals.ctypes.data
        row["triangles"], row["count"] = solid.mesh.triangles.ctypes.data, len(solid.mesh.triangles)
    return Packed(volumes, surfaces, convex + others, kept)


def _packed_volumes(solids: Sequence[Solid]) -> tuple[NDArray[np.void], list[Array]]:
    table, kept = np.zeros(len(solids), CONVEX), []
    for row, solid in zip(table, solids, strict=True):
        row["center"], row["rotation"], row["kind"] = solid.position, solid.rotation, KINDS.index(solid.kind)
        if solid.kind == "convex":
            assert solid.vertices is not None
            planes = _planes(solid.vertices.tobytes())
            kept.append(planes)
            row["planes"], row["count"] = planes.ctypes.data, len(planes)
            row["bound"] = np.linalg.norm(solid.vertices, axis=1).max()
        elif solid.kind == "box":
            row["half"] = 0.5 * np.array(solid.size)
            row["bound"] = np.linalg.norm(row["half"])
        else:
            radius, half_height = solid.size[0], 0.5 * solid.size[1] if len(solid.size) > 1 else 0.0
            row["half"] = radius, half_height, 0.0
            row["bound"] = np.hypot(radius, half_height) if solid.kind == "cylinder" else radius + half_height
    return table, kept


@lru_cache(maxsize=256)
def _planes(vertices: bytes) -> Array:
    """Return the outward unit normals and offsets (F, 4) of a hull's faces; `vertices`: the bytes of its vertices (V, 3)."""
    corners = facets(np.frombuffer(vertices).reshape(-1, 3))
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.column_stack([normals, (normals * corners[:, 0]).sum(axis=1)])


def _rotation_with_z(z: Array) -> Array:
    """Return a rotation (3, 3) whose z axis is this unit vector (3,)."""
    other = np.zeros(3)
    other[np.abs(z).argmin()] = 1.0
    x = np.cross(other, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])


def _thinned(points: Array) -> Array:
    """Return the points of a line without points closer than SHORTEST_PIECE to the kept point before; the last point is kept."""
    kept = [points[0]]
    for point in points[1:]:
        if np.linalg.norm(point - kept[-1]) >= SHORTEST_PIECE:
            kept.append(point)
    if np.any(kept[-1] != points[-1]):
        kept.append(points[-1])
    return np.array(kept)
