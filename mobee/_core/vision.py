# SPDX-License-Identifier: Apache-2.0
"""Regions of a colour, and distances of outlines from silhouettes; declares core/regions.cpp and core/silhouettes.cpp.

`regions` finds the regions in a picture, with their outlines. `Silhouette` computes the distances of an outline's points from the
silhouette of a shape, and the derivatives of these distances.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, REAL, address, function

Array = NDArray[np.float64]


class _Coloring(ctypes.Structure):
    """`Coloring` of core/regions.cpp."""

    _fields_ = (
        *((name, ADDRESS) for name in ("likeness", "points", "ends", "areas", "hulls")),
        *((name, INTEGER) for name in ("height", "width", "least", "around")),
    )


_regions = function("regions", ADDRESS, result=INTEGER)


@dataclass(frozen=True, slots=True, eq=False)
class Region:
    """A region of a colour in a picture; its holes are filled.

    `outline`: (m, 2) px, column and row of its points, in the order of their angle about the middle of the region. `area`: number of
    pixels, those of the holes included. `hull`: area of the convex hull of the outline, in pixels.
    """

    outline: NDArray[np.float64]
    area: int
    hull: float


def regions(likeness: NDArray[np.float32], least: float, around: int) -> list[Region]:
    """Return the regions of a colour in a picture: 4-connected sets of pixels in which the colour has at least half of the area.

    The regions inside one 8-connected set of pixels with a likeness above 0 are consecutive in the result.

    Args:
        likeness: how much of the colour is in each pixel (H, W), proportional to the share of the pixel that has the colour; 0: none.
        least: smallest area of a region, in pixels.
        around: side, in pixels (odd), of a square around each pixel. The share of the pixel's area that has the colour is estimated: its
            likeness, divided by the largest likeness in the square or by 1, whichever is larger.
    """
    likeness = np.ascontiguousarray(likeness, dtype=np.float32)
    smallest = max(1, int(np.ceil(least)))
    most = likeness.size // smallest + 1
    points = np.empty((4 * likeness.size, 2))  # pages that are not written take no memory
    ends, areas, hulls = np.empty(most, np.int64), np.empty(most, np.int64), np.empty(most)
    arrays = (address(array) for array in (likeness, points, ends, areas, hulls))
    given = _Coloring(*arrays, *likeness.shape, smallest, around)
    count: int = _regions(ctypes.addressof(given))
    outlines = np.split(points[: ends[count - 1] if count else 0].copy(), ends[: max(0, count - 1)])
    return [Region(one, int(area), float(hull)) for one, area, hull in zip(outlines, areas[:count], hulls[:count], strict=False)]


class _Silhouette(ctypes.Structure):
    """`Silhouette` of core/silhouettes.cpp."""

    _fields_ = (
        *(
            (name, ADDRESS)
            for name in ("flat", "inverse", "normals", "offsets", "farthest", "noise", "bias", "errors", "residual", "slopes")
        ),
        *((name, INTEGER) for name in ("points", "directions", "noises", "biases", "cameras", "number", "lengths", "turns")),
        ("length_of", INTEGER * 3),
        *((name, REAL * count) for name, count in (("origin", 3), ("view", 9), ("position", 3), ("turn", 9))),
        *((name, REAL) for name in ("shift", "wider", "shift_both")),
    )


_silhouette = function("silhouette", ADDRESS)


class Silhouette:
    """The outline of a shape in the picture of one camera, stored so that it can be compared with many computed silhouettes."""

    def __init__(
        self,
        camera: tuple[Array, Array, Array, Array],
        number: tuple[int, int],
        flat: Array,
        inverse: Array,
        normals: Array,
        length_of: Sequence[int],
        turns: bool,
        shifts: tuple[float, float, float],
    ) -> None:
        """Store the outline for the core; the arrays are those of core/silhouettes.cpp.

        Args:
            camera: four arrays: the camera's origin (3,) m; its rotation (3, 3) with the columns right, down and ahead; the factors (6, k)
                of its noise; and the factors (6, l) of its bias. A column of factors is the displacement (3 numbers, m) and the rotation
                (3 numbers, rad) of the camera that one unknown error causes if it is one standard deviation large.
            number: the index of this camera, and the number of cameras.
            flat: points (m, 2) of the outline in the plane at distance 1 of the camera.
            inverse: derivative of the points in this plane by their positions in pixels, (m, 2, 2).
            normals: normals of the K lines that touch the silhouette, (K, 2).
            length_of: for each of the three axes of the shape, the index of its length; axes may have the same length.
            turns: whether the angle of the shape about the vertical is unknown.
            shifts: standard deviations, px, of three errors of an outline: a shift along column and row, a shift outwards, and a shift
                that is common to the outlines in all pictures.
        """
        origin, view, noise, bias = camera
        self._kept = tuple(np.ascontiguousarray(array, dtype=np.float64) for array in (flat, inverse, normals, noise, bias))
        lengths, errors = max(length_of) + 1, noise.shape[1] + bias.shape[1] + 3 * number[1] + 2
        self._residual, self._slopes = np.empty(len(flat)), np.empty((len(flat), 3 + lengths + turns + errors))
        names = ("flat", "inverse", "normals", "noise", "bias", "residual", "slopes")
        arrays = zip(names, (*self._kept, self._residual, self._slopes), strict=True)
        self._given = _Silhouette(
            **{name: address(array) for name, array in arrays},
            points=len(flat),
            directions=len(normals),
            noises=noise.shape[1],
            biases=bias.shape[1],
            number=number[0],
            cameras=number[1],
            lengths=lengths,
            turns=turns,
            shift=shifts[0],
            wider=shifts[1],
            shift_both=shifts[2],
            length_of=(INTEGER * 3)(*length_of),
            origin=(REAL * 3)(*origin),
            view=(REAL * 9)(*view.ravel()),
        )

    def rows(self, position: Array, turn: Array, touching: tuple[Array, Array], errors: Array) -> tuple[Array, Array]:
        """Return the distances of the outline's m points from the computed silhouette, (m,) px, and their derivatives (m, p).

        A distance is positive outside the silhouette, and includes the effect of the errors. The p columns are the derivatives, in this
        order: by the position (3 columns), by the logarithm of each independent length of the shape (1 to 3 columns, see `length_of` of the
        constructor), by the angle about the vertical (1 column, none if the angle is known), and by the errors (e columns). The next call
        overwrites both arrays.

        Args:
            position: position of the shape's middle, (3,) m, root frame.
            turn: rotation of the shape's axes, (3, 3), root frame.
            touching: for each of the K `normals` that were given when this object was made, the point of the shape whose image is farthest
                along the normal. First these points (K, 3) m, relative to the shape's middle, in the camera's axes; then the coordinates
                (K,) of their images along the normals, in the plane at distance 1 of the camera.
            errors: (e,) estimated errors, each in units of its standard deviation: noise of the cameras, bias of the cameras, three shifts
                of the outline for each camera (along column, along row, outwards), and two shifts that are the same in all pictures (along
                column, along row).
        """
        given, (offsets, farthest) = self._given, (np.ascontiguousarray(array, dtype=np.float64) for array in touching)
        errors = np.ascontiguousarray(errors, dtype=np.float64)
        given.offsets, given.farthest, given.errors = address(offsets), address(farthest), address(errors)
        given.position[:], given.turn[:] = position.tolist(), turn.ravel().tolist()
        _silhouette(ctypes.addressof(given))
        return self._residual, self._slopes
