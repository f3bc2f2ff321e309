# SPDX-License-Identifier: Apache-2.0
"""Reads the meshes that a robot's file names, through trimesh, as triangles of one colour each, and simplifies large meshes."""

from __future__ import annotations

import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import NotInstalled, RobotFileError
from mobee.robot.mjcf.compiled import meshes_of
from mobee.robot.robot import Channels, MeshSource
from mobee.robot.urdf.mesh import LARGEST, first_file, mesh_places, searched

CREASE = 0.6  # cosine: an edge whose faces differ by more is drawn as an edge, not rounded
FORMATS = (".stl", ".obj", ".dae", ".ply", ".glb", ".gltf", ".off")
REMEDY = 'pip install "mobee[meshes]"'


@dataclass(frozen=True, slots=True, eq=False)
class Mesh:
    """Triangles of one colour, with normals for shading.

    `corners`: (v, 3) m. `normals`: (v, 3), unit vectors at the corners. `triangles`: (t, 3) indices of corners. `middle` (3,) m and
    `radius` [m]: a sphere that contains all corners. All are in the frame of the mesh. `color`: red, green, blue and opacity, 0 to 1; None:
    not given.
    """

    corners: NDArray[np.float32]
    normals: NDArray[np.float32]
    triangles: NDArray[np.int32]
    middle: Array
    radius: float
    color: Channels | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Piece:
    """Triangles of one colour as they are read from a file.

    `points`: (v, 3) m, in the frame of the mesh. `triangles`: (t, 3) indices of points. `color`: red, green, blue and opacity, 0 to 1;
    None: not given.
    """

    points: Array
    triangles: Ints
    color: Channels | None = None


def read_pieces(source: MeshSource) -> tuple[Piece, ...]:
    """Return the triangles of a mesh, relative to the frame of its visual, scaled; one piece for each object in its file.

    Raises RobotFileError if the file is missing or cannot be read, and NotInstalled without the package that reads it.
    """
    candidates = mesh_places(source.file, source.robot_file)
    path = first_file(candidates)
    if path is None:
        raise RobotFileError(f"no mesh {source.file!r} (looked at {searched(candidates)})")
    if source.name:
        found = meshes_of(path)
        if source.name not in found:
            raise RobotFileError(f"{path} has no mesh {source.name!r}")
        pieces = [Piece(*found[source.name])]
    else:
        pieces = list(_read(path))
    for piece in pieces:
        if not np.isfinite(piece.points).all():
            raise RobotFileError(f"{path}: has points that are not finite")
    return tuple(_scaled(piece, np.array(source.scale)) for piece in map(_merged, pieces) if len(piece.triangles))


def _scaled(piece: Piece, scale: Array) -> Piece:
    """Return the piece with its points multiplied by `scale` (3,).

    If the scale mirrors the piece (its product is negative), the corners of each triangle are reversed, so that its outside stays outside.
    """
    triangles = piece.triangles if scale.prod() > 0.0 else piece.triangles[:, ::-1]
    return replace(piece, points=piece.points * scale, triangles=triangles)


def _read(path: Path) -> Sequence[Piece]:
    """Read a mesh file with trimesh, each object of its scene in its place."""
    if path.suffix.lower() not in FORMATS:
        raise RobotFileError(f"{path}: meshes of type {path.suffix or 'unknown'!r} cannot be read; convert it to .stl, .obj or .dae")
    if path.stat().st_size > LARGEST:
        raise RobotFileError(f"{path}: the mesh is larger than {LARGEST // 1_000_000} MB")
    try:
        import trimesh
    except ImportError:
        raise NotInstalled(f"meshes need trimesh: {REMEDY}") from None
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)  # the caller reports what fails
    try:
        scene: Any = trimesh.load_scene(path, process=False)
        unit = re.match(r"([\d.eE+-]+) \* meters", str(scene.units or ""))
        objects = [(one, _color(one.visual)) for one in scene.dump() if isinstance(one, trimesh.Trimesh)]
    except ImportError as error:
        raise NotInstalled(f"{path.suffix} meshes need {error.name}: {REMEDY}") from None
    except Exception as error:  # trimesh and Pillow have no base class for the errors that a broken file causes
        raise RobotFileError(f"{path}: cannot be read ({type(error).__name__}: {error})") from None
    meter = float(unit[1]) if unit else 1.0
    return [Piece(meter * np.asarray(one.vertices), np.asarray(one.faces, dtype=np.intp), color) for one, color in objects]


def _color(visual: Any) -> Channels | None:
    """Return the mean colour of an object of trimesh; None if its file gives none."""
    if visual.kind is None:
        return None
    if visual.kind == "texture":
        material = visual.material
        image = getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
        found = np.array(material.main_color if image is None else image.convert("RGBA").resize((1, 1)).getpixel((0, 0)))
    else:
        found = np.asarray(visual.face_colors if visual.kind == "face" else visual.vertex_colors).mean(axis=0)
    red, green, blue, opacity = (found / 255.0).tolist()
    return red, green, blue, opacity


def _merged(piece: Piece) -> Piece:
    """Return the triangles with equal points made one, without triangles that have no area then."""
    points = piece.points.astype(np.float32)
    first, number = _each_once(points)
    points, triangles = points[first], number[piece.triangles]
    a, b, c = triangles.T
    triangles = triangles[(a != b) & (b != c) & (c != a)]
    return Piece(points.astype(np.float64), triangles, piece.color)


def smaller(piece: Piece, most: int) -> Piece:
    """Return the piece with at most about `most` triangles, simplified by edge collapses (quadric error).

    Raises NotInstalled without the package fast-simplification.
    """
    if len(piece.triangles) <= most:
        return piece
    try:
        from fast_simplification import simplify
    except ImportError:
        raise NotInstalled(f"large meshes need fast-simplification: {REMEDY}") from None
    centre = piece.points.mean(axis=0)
    size = float(np.ptp(piece.points, axis=0).max()) or 1.0  # the package has thresholds of its own, for sizes near 1
    points, triangles = simplify(((piece.points - centre) / size), piece.triangles.astype(np.int32), target_count=max(most, 4))
    if not len(triangles) or not np.isfinite(points).all():
        return piece
    return replace(piece, points=size * points.astype(np.float64) + centre, triangles=triangles.astype(np.intp))


def simplified(mesh: Mesh, most: int) -> Mesh:
    """Return the mesh with at most about `most` triangles; raise NotInstalled without the package fast-simplification."""
    if len(mesh.triangles) <= most:
        return mesh
    return mesh_of(smaller(_merged(Piece(mesh.corners.astype(np.float64), mesh.triangles.astype(np.intp), mesh.color)), most))


def fair_most(counts: Sequence[int], budget: int) -> int:
    """Return the limit to which the number of triangles of each piece must be reduced, so that all pieces together have at most `budget`.

    It is the largest such limit; if no piece must be reduced, it is the largest count. `counts`: number of triangles of each piece.
    """
    left = budget
    for rest, count in zip(range(len(counts), 0, -1), sorted(counts), strict=True):
        if count * rest > left:
            return left // rest
        left -= count
    return max(counts, default=0)


def mesh_of(piece: Piece) -> Mesh:
    """Return the piece as a mesh with normals: smooth where faces meet at a small angle, with a visible edge otherwise."""
    corners = piece.points[piece.triangles]  # (t, 3, 3)
    areas = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(areas, axis=1, keepdims=True)
    faces = areas / np.where(lengths > 0.0, lengths, 1.0)
    at = piece.triangles.reshape(-1)  # the point of each corner; corner k belongs to triangle k // 3
    order = np.argsort(at, kind="stable")
    counts = np.bincount(at, minlength=len(piece.points))
    starts = np.concatenate([[0], np.cumsum(counts)])
    here = np.repeat(np.arange(len(at)), counts[at])  # pairs of corners at one point
    there = order[np.arange(len(here)) - np.repeat(np.cumsum(counts[at]) - counts[at], counts[at]) + starts[at][here]]
    flat = (faces[here // 3] * faces[there // 3]).sum(axis=1) > CREASE
    normals = np.zeros((len(at), 3))
    np.add.at(normals, here[flat], areas[there[flat] // 3])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    first, number = _each_once(np.column_stack([at, np.round(normals, 2)]))
    middle = (piece.points.min(axis=0) + piece.points.max(axis=0)) / 2.0
    radius = float(np.linalg.norm(piece.points - middle, axis=1).max())
    shared = piece.points[at[first]].astype(np.float32), normals[first].astype(np.float32)
    return Mesh(*shared, number.reshape(-1, 3).astype(np.int32), middle, radius, piece.color)


def _each_once(rows: NDArray[Any]) -> tuple[Ints, Ints]:
    """Return the indices (u,) of one of each of the u different rows in `rows` (n, k), in ascending order of the rows' values.

    The second result (n,) has for each row the position of its equal in the first.
    """
    order = np.lexsort(rows.T[::-1])  # np.unique takes several times as long
    new = np.append(True, (rows[order[1:]] != rows[order[:-1]]).any(axis=1))
    number = np.empty(len(rows), dtype=np.intp)
    number[order] = np.cumsum(new) - 1
    return order[new], number


def ellipsoid_piece(half: Sequence[float]) -> Piece:
    """Return the triangles of an ellipsoid; `half`: its half axes along x, y and z [m]."""
    rows, columns = 12, 24
    angles, turns = np.linspace(0.0, np.pi, rows + 1), np.linspace(0.0, 2.0 * np.pi, columns, endpoint=False)
    ring = np.stack([np.cos(turns), np.sin(turns), np.zeros(columns)], axis=1)
    points = np.sin(angles)[:, None, None] * ring + np.cos(angles)[:, None, None] * np.array([0.0, 0.0, 1.0])
    row, column = (one.ravel() for one in np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij"))
    a, b = row * columns + column, row * columns + (column + 1) % columns
    triangles = np.concatenate([np.stack([a, a + columns, b], axis=1), np.stack([b, a + columns, b + columns], axis=1)])
    return _merged(Piece(np.round(points.reshape(-1, 3), 12) * np.array(half), triangles))
