"""Where parallel rays enter a convex volume, and its normal there."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from experiments.drawing.solid import Solid
from mobee.arrays import Array
from mobee.robot.urdf.hull import facets

Floats = NDArray[np.floating]
FLAT = 1e-9  # of a ray's direction: it runs along a face


def entered(solid: Solid, starts: Floats, ahead: Array) -> tuple[Floats, Floats]:
    """How far ahead rays from `starts` (3, ...) m, in the solid's own axes about its position, enter it: (...) m, infinite where they miss.

    `ahead` (3,): their direction, a unit vector in the same axes.  Also the outward normals there, (3, ...), in these axes.
    """
    if solid.kind == "sphere":
        return _sphere(starts, ahead, solid.size[0], 0.0)
    if solid.kind == "box":
        faces = np.vstack([np.eye(3), -np.eye(3)])
        return _faces(starts, ahead, faces, 0.5 * np.tile(np.array(solid.size), 2))
    if solid.kind == "cylinder":
        return _cylinder(starts, ahead, *solid.size)
    if solid.kind == "capsule":
        return _capsule(starts, ahead, *solid.size)
    assert solid.vertices is not None
    corners = facets(solid.vertices)
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    faces /= np.linalg.norm(faces, axis=1, keepdims=True)
    return _faces(starts, ahead, faces, (faces * corners[:, 0]).sum(axis=1))


def _faces(starts: Floats, ahead: Array, faces: Array, offsets: Array) -> tuple[Floats, Floats]:
    """What lies behind all of the planes normal . x = offset."""
    enter, leave = np.full(starts.shape[1:], -np.inf, starts.dtype), np.full(starts.shape[1:], np.inf, starts.dtype)
    which = np.zeros(starts.shape[1:], dtype=np.intp)
    for number, (normal, offset) in enumerate(zip(faces, offsets, strict=True)):
        before = offset - np.tensordot(normal.astype(starts.dtype), starts, 1)
        slope = float(normal @ ahead)
        if abs(slope) < FLAT:
            leave[before < 0.0] = -np.inf
        elif slope < 0.0:
            at = before / starts.dtype.type(slope)
            later = at > enter
            enter[later], which[later] = at[later], number
        else:
            np.minimum(leave, before / starts.dtype.type(slope), out=leave)
    enter[enter > leave] = np.inf
    return enter, np.moveaxis(faces.astype(starts.dtype)[which], -1, 0)


def _sphere(starts: Floats, ahead: Array, radius: float, z: float) -> tuple[Floats, Floats]:
    """A sphere about (0, 0, z)."""
    around = starts - np.array([0.0, 0.0, z], starts.dtype).reshape(3, *[1] * (starts.ndim - 1))
    middle = -np.tensordot(ahead.astype(starts.dtype), around, 1)
    left = middle**2 - (around**2).sum(axis=0) + radius**2
    at = np.where(left >= 0.0, middle - np.sqrt(np.maximum(left, 0.0)), np.inf)
    return at, _normals(around, ahead, at, radius)


def _normals(around: Floats, ahead: Array, at: Floats, radius: float) -> Floats:
    reached = np.where(np.isfinite(at), at, 0.0).astype(around.dtype)
    found: Floats = (around + reached * ahead.astype(around.dtype).reshape(3, *[1] * at.ndim)) / around.dtype.type(radius)
    return found


def _mantle(starts: Floats, ahead: Array, radius: float) -> tuple[Floats, Floats]:
    """Where rays enter and leave the endless cylinder about z; (inf, -inf) where they miss."""
    flat = float(ahead[0] ** 2 + ahead[1] ** 2)
    beside = (starts[:2] ** 2).sum(axis=0) - radius**2
    if flat < FLAT:
        return np.where(beside <= 0.0, -np.inf, np.inf), np.where(beside <= 0.0, np.inf, -np.inf)
    half = (starts[0] * starts.dtype.type(ahead[0]) + starts[1] * starts.dtype.type(ahead[1])) / starts.dtype.type(flat)
    left = half**2 - beside / starts.dtype.type(flat)
    root = np.sqrt(np.maximum(left, 0.0))
    return np.where(left >= 0.0, -half - root, np.inf), np.where(left >= 0.0, -half + root, -np.inf)


def _cylinder(starts: Floats, ahead: Array, radius: float, height: float) -> tuple[Floats, Floats]:
    ends = np.array([[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]])
    lid, normals = _faces(starts, ahead, ends, np.full(2, 0.5 * height))
    leaves = _leaves(starts, ahead, height)
    enter, leave = _mantle(starts, ahead, radius)
    side = enter > lid
    at = np.where(np.isinf(lid) & (lid > 0.0), np.inf, np.maximum(enter, lid))
    at = np.where(at <= np.minimum(leave, leaves), at, np.inf)
    round_about = _normals(starts, ahead, at, radius)
    round_about[2] = 0.0
    return at, np.where(side, round_about, normals)


def _leaves(starts: Floats, ahead: Array, height: float) -> Floats:
    """Where rays leave the layer |z| <= height / 2, which they enter somewhere."""
    if abs(ahead[2]) < FLAT:
        return np.full(starts.shape[1:], np.inf, starts.dtype)
    found: Floats = (starts.dtype.type(np.sign(ahead[2]) * 0.5 * height) - starts[2]) / starts.dtype.type(ahead[2])
    return found


def _capsule(starts: Floats, ahead: Array, radius: float, height: float) -> tuple[Floats, Floats]:
    """The nearest of the mantle, where it is one, and the two spheres."""
    at, _ = _mantle(starts, ahead, radius)
    normals = _normals(starts, ahead, at, radius)
    z = starts[2] + np.where(np.isfinite(at), at, 0.0).astype(starts.dtype) * starts.dtype.type(ahead[2])
    at = np.where(np.isfinite(at) & (np.abs(z) <= 0.5 * height), at, np.inf)
    normals[2] = 0.0
    for end in (0.5 * height, -0.5 * height):
        cap, outwards = _sphere(starts, ahead, radius, end)
        nearer = cap < at
        at, normals = np.where(nearer, cap, at), np.where(nearer, outwards, normals)
    return at, normals
