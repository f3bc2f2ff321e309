# SPDX-License-Identifier: Apache-2.0
"""Regions of a colour in a picture, and their outlines; declares core/regions.cpp."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, address, function


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
