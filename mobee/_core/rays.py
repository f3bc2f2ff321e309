# SPDX-License-Identifier: Apache-2.0
"""Draws convex volumes by one ray a pixel, and surfaces of triangles; declares core/rays.cpp and core/triangles.cpp."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]
Floats = NDArray[np.float32]

_PLACE = [("center", np.float64, 3), ("rotation", np.float64, (3, 3))]

CONVEX = np.dtype(
    [
        *_PLACE,
        ("half", np.float64, 3),
        ("bound", np.float64),
        ("kind", np.int64),
        ("planes", np.uint64),
        ("count", np.int64),
    ],
    align=True,
)
"""`Convex` of core/picture.hpp; `planes` is an address, and the caller keeps the planes alive."""

SURFACE = np.dtype(
    [
        *_PLACE,
        ("middle", np.float64, 3),
        ("bound", np.float64),
        ("corners", np.uint64),
        ("normals", np.uint64),
        ("triangles", np.uint64),
        ("count", np.int64),
        ("number", np.int64),
    ],
    align=True,
)
"""`Surface` of core/picture.hpp; the addresses are of float32 (v, 3), float32 (v, 3) and int32 (t, 3), which the caller keeps alive."""

KINDS = ("sphere", "capsule", "cylinder", "box", "convex")


class _Picture(ctypes.Structure):
    """`Picture` of core/picture.hpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("volumes", "surfaces", "depth", "which", "normal")),
        *((name, INTEGER) for name in ("count", "surface_count", "height", "width", "perspective")),
        *((name, REAL * 3) for name in ("origin", "right", "down", "ahead")),
        *((name, REAL) for name in ("left", "top", "step", "nearest")),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The rays of a picture: through column i and row j, at x = left + i step and y = top + j step of the plane 1 m ahead of `origin`.

    `axes` (3, 3): rows are right, down and ahead, in the root frame.  In a parallel picture all rays run along ahead, and x and y are
    metres.  A surface nearer than `nearest` m is not drawn.
    """

    axes: Array
    origin: Array
    left: float
    top: float
    step: float
    height: int
    width: int
    perspective: bool
    nearest: float


_cast = function("cast", ADDRESS)
_convex_size = function("convex_size", result=INTEGER)
_surface_size = function("surface_size", result=INTEGER)


def cast(volumes: NDArray[np.void], surfaces: NDArray[np.void], rays: Rays) -> tuple[Floats, NDArray[np.int32], Floats]:
    """Return the first volume or surface that each ray hits, among volumes (N,) `CONVEX` and surfaces (M,) `SURFACE`.

    Depths (H, W) m along the axis ahead, infinite where there is nothing; indices of volumes, or numbers of surfaces, (H, W), -1 where
    there is nothing; and outward normals (H, W, 3), root frame.
    """
    for table, row, size in ((volumes, CONVEX, _convex_size()), (surfaces, SURFACE, _surface_size())):
        if table.dtype != row or row.itemsize != size:
            raise RuntimeError(f"the library's rows have {size} bytes and another layout than {table.dtype}")
    shape = rays.height, rays.width
    depth, which, normal = np.empty(shape, np.float32), np.empty(shape, np.int32), np.empty((*shape, 3), np.float32)
    arrays = (address(array) for array in (volumes, surfaces, depth, which, normal))
    vectors = ((REAL * 3)(*vector) for vector in (rays.origin, *rays.axes))
    numbers = (rays.left, rays.top, rays.step, rays.nearest)
    picture = _Picture(*arrays, len(volumes), len(surfaces), *shape, rays.perspective, *vectors, *numbers)
    _cast(ctypes.addressof(picture))
    return depth, which, normal
