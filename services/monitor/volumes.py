"""A volume as Rerun draws it: one way for shapes of a robot and objects of a world."""

from __future__ import annotations

import numpy as np
import rerun as rr

from mobee.kinematics.quaternion import from_matrix
from mobee.robot.robot import Array, ShapeKind
from mobee.robot.urdf.hull import facets
from services.monitor.palette import Rgba


def drawn(
    kind: ShapeKind, size: tuple[float, ...], position: Array, rotation: Array, color: Rgba, vertices: Array | None = None
) -> rr.AsComponents:
    """The volume at position (3,) m, turned by rotation (3, 3), filled with the colour."""
    w, x, y, z = from_matrix(rotation)
    common = {"quaternions": [rr.Quaternion(xyzw=[x, y, z, w])], "colors": [color], "fill_mode": "solid"}
    if kind == "convex":
        return _mesh(position + (np.empty((0, 3)) if vertices is None else vertices) @ rotation.T, color)
    if kind == "box":
        return rr.Boxes3D(sizes=[size], centers=[position], **common)
    if kind == "sphere":
        return rr.Ellipsoids3D(radii=[size[0]], centers=[position], **common)
    if kind == "capsule":  # drawn from one end
        start = position - rotation[:, 2] * size[1] / 2.0
        return rr.Capsules3D(radii=[size[0]], lengths=[size[1]], translations=[start], **common)
    return rr.Cylinders3D(radii=[size[0]], lengths=[size[1]], centers=[position], **common)


def recolored(kind: ShapeKind, color: Rgba) -> rr.AsComponents:
    """What changes the colour of a volume that is drawn already."""
    if kind == "convex":
        return rr.Mesh3D.from_fields(albedo_factor=color)
    archetypes = {"box": rr.Boxes3D, "sphere": rr.Ellipsoids3D, "capsule": rr.Capsules3D, "cylinder": rr.Cylinders3D}
    return archetypes[kind].from_fields(colors=[color])


def _mesh(points: Array, color: Rgba) -> rr.Mesh3D:
    """The hull of points (v, 3) with flat faces: every triangle has corners of its own."""
    corners = facets(points)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return rr.Mesh3D(
        vertex_positions=corners.reshape(-1, 3),
        triangle_indices=np.arange(3 * len(corners)).reshape(-1, 3),
        vertex_normals=np.repeat(normals, 3, axis=0),
        albedo_factor=color,
    )
