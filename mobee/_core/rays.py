# SPDX-License-Identifier: Apache-2.0
"""Draws convex volumes by one ray for each pixel, and surfaces of triangles; declares core/rays.cpp and core/triangles.cpp."""

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
"""The type of a convex volume to be drawn, `Convex` of core/picture.hpp; `planes` is the address of the planes of a hull, which the caller
keeps alive."""

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
"""The type of a surface of triangles to be drawn, `Surface` of core/picture.hpp. `corners`, `normals` and `triangles` are addresses of
arrays float32 (v, 3), float32 (v, 3) and int32 (t, 3), which the caller keeps alive."""

KINDS = ("sphere", "capsule", "cylinder", "box", "convex")


class _Picture(ctypes.Structure):
    """`Picture` of core/picture.hpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("volumes", "surfaces", "depth", "which", "normal", "before", "columns")),
        *((name, INTEGER) for name in ("rays", "count", "surface_count", "height", "width", "perspective")),
        *((name, REAL * 3) for name in ("origin", "right", "down", "ahead")),
        *((name, REAL) for name in ("left", "top", "step", "nearest")),
    )


class _Light(ctypes.Structure):
    """`Light` of core/picture.hpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("which", "normal", "rays", "colors", "brightness")),
        ("count", INTEGER),
        ("towards", REAL * 3),
        ("nothing", ctypes.c_float * 3),
        *((name, ctypes.c_float) for name in ("ambient", "diffuse")),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Chosen:
    """K chosen pixels of a picture (H, W), numbered row by row.

    `before` (H, W + 1): before[i, j] is the number of chosen pixels in all rows above row i, and in the first j columns of row i.
    `columns` (K + 3,): the column of each chosen pixel, then three zeros that belong to no pixel.
    """

    before: NDArray[np.int32]
    columns: NDArray[np.int32]

    @classmethod
    def of(cls, mask: NDArray[np.bool_]) -> Chosen:
        """Return the pixels that are True in a mask (H, W)."""
        before = np.zeros((mask.shape[0], mask.shape[1] + 1), np.int32)
        before[:, 1:] = np.cumsum(mask.ravel()).reshape(mask.shape)
        before[1:, 0] = before[:-1, -1]
        return cls(before, np.append(np.nonzero(mask)[1], [0, 0, 0]).astype(np.int32))

    @property
    def count(self) -> int:
        """The number K of chosen pixels."""
        return len(self.columns) - 3


@dataclass(frozen=True, slots=True, eq=False)
class Lamp:
    """A lamp far away, in the direction `towards` (3,), a unit vector in the root frame.

    `ambient`: factor on the colour of a surface that is turned away from the lamp. `ambient` + `diffuse`: the factor if the surface faces
    the lamp. `nothing`: red, green and blue, 0 to 255, of a pixel that shows neither volume nor surface.
    """

    towards: tuple[float, float, float]
    ambient: float
    diffuse: float
    nothing: tuple[float, float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """The rays of a picture of height x width pixels, one for each pixel.

    The ray of column i and row j passes through the point x = left + i step, y = top + j step of the plane 1 m ahead of `origin` (3,) m.
    `axes` (3, 3): the rows are the directions right (x), down (y) and ahead of the camera, in the root frame.  `perspective`: True: all
    rays begin at `origin`; False: each ray begins at its point x, y [m] of the plane through `origin`, in the direction ahead.  A surface
    nearer than `nearest` m is not drawn.
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
_shade = function("shade", ADDRESS)
_convex_size = function("convex_size", result=INTEGER)
_surface_size = function("surface_size", result=INTEGER)


def cast(
    volumes: NDArray[np.void], surfaces: NDArray[np.void], rays: Rays, chosen: Chosen | None = None
) -> tuple[Floats, NDArray[np.int32], Floats]:
    """Find the first volume or surface that each ray hits; return three arrays: depths, indices and normals.

    `volumes`: (N,) rows of the type CONVEX. `surfaces`: (M,) rows of the type SURFACE. Depths (H, W) m are along the axis ahead, infinite
    if the ray hits nothing. Indices (H, W): the row of a volume in `volumes`, or the field "number" of a surface; -1: nothing. Normals
    (H, W, 3) point outward, root frame. With K `chosen` pixels only their rays are computed, and the shapes are (K,), (K,) and (K, 3).
    """
    for table, row, size in ((volumes, CONVEX, _convex_size()), (surfaces, SURFACE, _surface_size())):
        if table.dtype != row or row.itemsize != size:
            raise RuntimeError(f"the library's rows have {size} bytes and another layout than {table.dtype}")
    shape = (rays.height, rays.width) if chosen is None else (chosen.count,)
    if chosen is not None and chosen.before.shape != (rays.height, rays.width + 1):
        raise ValueError(f"pixels chosen of a picture of another size than {rays.width} x {rays.height}")
    depth, which, normal = np.empty(shape, np.float32), np.empty(shape, np.int32), np.empty((*shape, 3), np.float32)
    arrays = (address(array) for array in (volumes, surfaces, depth, which, normal))
    choice = (None, None) if chosen is None else (address(chosen.before), address(chosen.columns))
    vectors = ((REAL * 3)(*vector) for vector in (rays.origin, *rays.axes))
    numbers = (depth.size, len(volumes), len(surfaces), rays.height, rays.width, rays.perspective)
    picture = _Picture(*arrays, *choice, *numbers, *vectors, rays.left, rays.top, rays.step, rays.nearest)
    _cast(ctypes.addressof(picture))
    return depth, which, normal


def shade(which: NDArray[np.int32], normal: Floats, pixels: NDArray[np.int64], colors: Floats, lamp: Lamp, brightness: Floats) -> None:
    """Compute the colour of each of K pixels in the light of the lamp, and add it to the `brightness` of the pixel, in place.

    `brightness` (K, 3): red, green and blue; each number increases by 0 to 255. `which` and `normal`: what `cast` returns for R rays: the
    index of the volume or surface that each ray hits (R numbers), and the normal there (3 R numbers). `pixels` (K,): for each pixel, the
    index of its ray (0 to R - 1). `colors` (N, 3): row k is the red, green and blue, 0 to 255, of the volume or surface with the index k.
    """
    arrays = (address(array) for array in (which, normal, pixels, colors, brightness))
    towards, nothing = (REAL * 3)(*(float(np.float32(one)) for one in lamp.towards)), (ctypes.c_float * 3)(*lamp.nothing)
    light = _Light(*arrays, len(pixels), towards, nothing, lamp.ambient, lamp.diffuse)
    _shade(ctypes.addressof(light))
