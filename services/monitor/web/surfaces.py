# SPDX-License-Identifier: Apache-2.0
"""The robot as triangles, for the 3D view that the monitor's web page draws itself; its other 3D view is the Rerun viewer."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from mobee.arrays import Array, Ints
from mobee.rendering.palette import Color
from mobee.rendering.solid import LinkSolid, Solid, coarser, link_solids
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import facets

COLOR: Color = (168, 174, 184)  # of the robot's solids; the page adds that of the part's agent
BUDGET = 9000  # triangles of meshes
ROUND = 20  # corners of a circle
BLOCK = 4  # bytes to which the header is padded: the arrays that follow are read in place


@dataclass(frozen=True, eq=False)
class Surface:
    """Triangles of one colour that move with one link.

    `link`: index of the link. `part`: index of the part that the link belongs to; -1: none. `vertices`: (v, 3) m, in the root frame with
    every joint at zero. `normals`: unit normal of each vertex, (v, 3). `triangles`: indices of the vertices, (t, 3), anticlockwise as seen
    from outside.
    """

    link: int
    part: int
    color: Color
    vertices: Array
    normals: Array
    triangles: Ints


def surfaces_of(robot: Robot) -> Callable[[], bytes]:
    """Return a function that returns the triangles of a robot as bytes, in the format of `encoded`.

    The triangles are computed at the first call and then kept.
    """
    return cache(lambda: encoded(_surfaces(robot)))


def _surfaces(robot: Robot) -> list[Surface]:
    """Return what is drawn of a robot, with meshes as fine as JavaScript draws in some milliseconds."""
    parts = list(robot.parts)
    return [_surface(one, parts) for one in coarser(link_solids(robot), BUDGET)]


def _surface(one: LinkSolid, parts: Sequence[str]) -> Surface:
    solid = one.solid
    if solid.mesh is not None:
        made: Made = solid.mesh.corners.astype(np.float64), solid.mesh.normals.astype(np.float64), solid.mesh.triangles.astype(np.intp)
    else:
        made = MAKERS[solid.kind](solid)
    vertices, normals = made[0] @ solid.rotation.T + solid.position, made[1] @ solid.rotation.T
    red, green, blue = (round(255.0 * channel) for channel in solid.color)
    color = COLOR if one.collides else (red, green, blue)
    return Surface(one.link, parts.index(one.part) if one.part in parts else -1, color, vertices, normals, made[2])


def encoded(surfaces: Sequence[Surface]) -> bytes:
    """Encode surfaces as the bytes that the monitor's web page reads, all little-endian.

    Order: length of the header in bytes (uint32); the header; then for each surface its vertices and normals (float32) and triangles
    (uint32). The header is a JSON list, padded with spaces: for each surface its link, part and colour, and how many vertices and triangles
    it has.
    """
    rows = [
        {"link": one.link, "part": one.part, "color": one.color, "vertices": len(one.vertices), "triangles": len(one.triangles)}
        for one in surfaces
    ]
    header = json.dumps(rows).encode()
    header += b" " * (-len(header) % BLOCK)
    pieces = [struct.pack("<I", len(header)), header]
    for one in surfaces:
        pieces += [one.vertices.astype("<f4").tobytes(), one.normals.astype("<f4").tobytes(), one.triangles.astype("<u4").tobytes()]
    return b"".join(pieces)


Made = tuple[Array, Array, Ints]  # vertices, normals, triangles, in the frame of the solid


def flat(corners: Array) -> Made:
    """Return triangles with flat shading as vertices (3 t, 3), normals (3 t, 3) and indices (t, 3).

    `corners`: (t, 3, 3) m; corners[i, j] is the position (x, y, z) of corner j of triangle i. Triangles share no vertices.
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    return corners.reshape(-1, 3), np.repeat(normals, 3, axis=0), np.arange(3 * len(corners)).reshape(-1, 3)


def _box(solid: Solid) -> Made:
    half = 0.5 * np.array(solid.size)
    return flat(facets(np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half))


def _convex(solid: Solid) -> Made:
    return flat(facets(np.empty((0, 3)) if solid.vertices is None else solid.vertices))


def _turned(profile: Array, normals: Array) -> Made:
    """Return the surface of revolution of a profile about the z axis: vertices, normals and triangles.

    `profile`: (p, 2), radius and height of each point [m], in order from the lowest. `normals`: (p, 2), outward normals there,
    as radial and vertical components.
    """
    angles = np.linspace(0.0, 2.0 * np.pi, ROUND + 1)
    cosine, sine = np.cos(angles)[:, None], np.sin(angles)[:, None]

    def around(pairs: Array) -> Array:
        radius, height = pairs.T
        return np.stack(np.broadcast_arrays(cosine * radius, sine * radius, height), axis=2).reshape(-1, 3)

    rows, columns = np.meshgrid(np.arange(ROUND), np.arange(len(profile) - 1), indexing="ij")
    first = (rows * len(profile) + columns).ravel()
    beside = first + len(profile)
    triangles = np.vstack([np.column_stack([first, beside, beside + 1]), np.column_stack([first, beside + 1, first + 1])])
    return around(profile), around(normals), triangles


def _capsule(solid: Solid) -> Made:
    radius, half = solid.size[0], 0.5 * solid.size[1] if solid.kind == "capsule" else 0.0
    angles = np.linspace(-0.5 * np.pi, 0.5 * np.pi, ROUND // 2 + 1)
    directions = np.column_stack([np.cos(angles), np.sin(angles)])
    middle = len(angles) // 2
    directions = np.insert(directions, middle, directions[middle], axis=0)  # the equator twice: of the lower and the upper half
    lift = np.where(np.arange(len(directions)) <= middle, -half, half)
    return _turned(radius * directions + np.column_stack([np.zeros(len(lift)), lift]), directions)


def _cylinder(solid: Solid) -> Made:
    radius, half = solid.size[0], 0.5 * solid.size[1]
    profile = np.array([[0.0, -half], [radius, -half], [radius, -half], [radius, half], [radius, half], [0.0, half]])
    return _turned(profile, np.array([[0.0, -1.0], [0.0, -1.0], [1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 1.0]]))


MAKERS: dict[str, Callable[[Solid], Made]] = {
    "box": _box,
    "convex": _convex,
    "sphere": _capsule,
    "capsule": _capsule,
    "cylinder": _cylinder,
}
