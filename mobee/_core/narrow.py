# SPDX-License-Identifier: Apache-2.0
"""Overlaps and distances of many pairs of volumes, for tests and benchmarks of the narrow phase of the compiled core (C++ library)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee._core import ADDRESS, INTEGER, address, function

Reals = NDArray[np.float64]

KINDS = ("sphere", "capsule", "cylinder", "box", "convex")

VOLUME = np.dtype(
    [
        ("center", np.float64, 3),
        ("rotation", np.float64, (3, 3)),
        ("half", np.float64, 3),
        ("core", np.float64, 3),
        ("radius", np.float64),
        ("bound", np.float64),
        ("squared", np.float64),
        ("inverse", np.float64),
        ("kind", np.int32),
        ("corners", np.uint64),
        ("count", np.int32),
        ("starts", np.uint64),
        ("edges", np.uint64),
    ],
    align=True,
)
"""The type of a placed volume, `Volume` of core/volume.hpp; the last four members are the corners and edges of a hull."""

TOUCH = np.dtype([("normal", np.float64, 3), ("point", np.float64, 3)])

_volume_size = function("volume_size", result=INTEGER)
_overlap = function("overlap", ADDRESS, ADDRESS, INTEGER, ADDRESS, ADDRESS)
_distance = function("distance", ADDRESS, ADDRESS, INTEGER, ADDRESS)
_cut = function("cut", ADDRESS, INTEGER, ADDRESS, ADDRESS, INTEGER, result=INTEGER)


class Volumes:
    """An array of volumes placed in the root frame, which the compiled core reads without a copy.

    The object also holds the corners of hulls, to which the array has pointers.
    """

    def __init__(self, count: int) -> None:
        self.table = np.zeros(count, dtype=VOLUME)
        self._kept: list[NDArray[Any]] = []
        if VOLUME.itemsize != _volume_size():
            raise RuntimeError("the library's volumes have another layout than these")

    def place(self, at: int, kind: str, half: Sequence[float] | Reals, position: Reals, rotation: Reals) -> None:
        """Set the volume at index `at`, with `position` (3,) m and `rotation` (3, 3) in the root frame.

        `kind`: "sphere", "capsule", "cylinder", "box" or "convex" (a hull). `half` [m]: (radius,) of a sphere; (radius, half height) of a
        capsule or cylinder; half edges (3,) of a box; () for a hull, whose corners are set by `hull`.
        """
        row = self.table[at]
        size = np.zeros(3)
        size[: len(half)] = half
        row["kind"], row["half"], row["center"], row["rotation"] = KINDS.index(kind), size, position, rotation
        row["radius"] = 0.0 if kind in ("box", "convex") else size[0]
        row["bound"] = size[0] + size[1] if kind in ("sphere", "capsule") else np.linalg.norm(size)
        if kind in ("capsule", "cylinder"):
            row["core"] = np.asarray(rotation)[:, 2] * size[1]
            row["squared"] = size[1] ** 2
            row["inverse"] = 1.0 / row["squared"] if row["squared"] > 0.0 else 0.0

    def hull(self, at: int, corners: Reals, neighbours: Sequence[Sequence[int]] | None = None) -> None:
        """Set the corners (v, 3) m of the hull at index `at`, relative to its position, along its own axes.

        `neighbours`: for each corner, the indices of the corners to which an edge joins it; None: no edges, the core tries all corners.
        """
        corners = np.ascontiguousarray(corners, dtype=np.float64)
        row = self.table[at]
        row["corners"], row["count"], row["bound"] = address(corners), len(corners), np.linalg.norm(corners, axis=1).max()
        self._kept.append(corners)
        if neighbours is not None:
            starts = np.cumsum([0, *map(len, neighbours)]).astype(np.int32)
            edges = np.concatenate([np.asarray(one, dtype=np.int32) for one in neighbours])
            row["starts"], row["edges"] = address(starts), address(edges)
            self._kept += [starts, edges]

    def taken(self, at: NDArray[np.int64]) -> Volumes:
        """Return a new array with the volumes at these indices, in this order."""
        taken = Volumes(0)
        taken.table, taken._kept = self.table[at], self._kept
        return taken

    def __len__(self) -> int:
        return len(self.table)


def overlaps(first: Volumes, second: Volumes) -> tuple[Reals, NDArray[Any]]:
    """Return the depths (p,) m and the touches (p,) of p pairs of volumes, first[i] with second[i].

    A touch is a row of TOUCH, in the root frame: the unit normal (3,) in whose direction the first volume must move by the depth to leave
    the second one, and the point (3,) m of the contact. Depth and touch are NaN for a pair that does not touch.
    """
    depth, touch = np.empty(len(first)), np.zeros(len(first), dtype=TOUCH)
    touch["normal"] = touch["point"] = np.nan
    _overlap(*_pairs(first, second), address(depth), address(touch))
    return depth, touch


def distances(first: Volumes, second: Volumes) -> Reals:
    """Return the distances (p,) m of p pairs of volumes, of first[i] from second[i]; 0 for a pair that overlaps."""
    apart = np.empty(len(first))
    _distance(*_pairs(first, second), address(apart))
    return apart


def cut(points: Reals, line: Reals, room: int) -> Reals:
    """Clip a convex polygon `points` (n, 2) by a half-plane; return the clipped polygon (k, 2). Only tests call this.

    `room`: largest number k of returned points; further points are left out. `line` (4,): a point (2 numbers) on the border of the
    half-plane, and the border's inward normal (2 numbers).
    """
    points, line, out = np.ascontiguousarray(points, float), np.ascontiguousarray(line, float), np.full((room + 8, 2), np.nan)
    if points.ndim != 2 or points.shape[1] != 2 or len(points) == 0 or line.shape != (4,):
        raise ValueError(f"a polygon is (n, 2) and a line (4,), not {points.shape} and {line.shape}")
    left = _cut(address(points), len(points), address(line), address(out), room)
    if not np.isnan(out[room:]).all():
        raise RuntimeError("the core wrote beyond its memory")
    return out[:left]


def _pairs(first: Volumes, second: Volumes) -> tuple[int, int, int]:
    if len(first) != len(second):
        raise ValueError(f"{len(first)} volumes cannot be paired with {len(second)}")
    return address(first.table), address(second.table), len(first)
