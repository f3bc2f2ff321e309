# SPDX-License-Identifier: Apache-2.0
"""Volumes (spheres, capsules, cylinders, boxes, convex hulls) as rows of a table that the compiled core reads."""

from __future__ import annotations

import math
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.robot.robot import ShapeKind

CODES: dict[ShapeKind, int] = {"sphere": 0, "capsule": 1, "cylinder": 2, "box": 3, "convex": 4}

VOLUME = np.dtype(
    [
        ("kind", np.int64),
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (3, 3)),
        ("half", np.float64, (3,)),
        ("bound", np.float64),
    ]
)
"""The type of a row that describes a volume, `VolumeRow` of core/robot.hpp.  `kind`: 0 sphere, 1 capsule, 2 cylinder, 3 box, 4 convex.
`half` [m]: sphere (r, 0, 0); capsule and cylinder (r, half height, 0); box half edges; convex (first corner in the table of corners,
number of corners, 0).  `bound`: radius [m] of the ball about the position that contains the volume."""

Volumes = NDArray[Any]  # of VOLUME


class Volume(Protocol):
    """The members that a robot's Shape and a WorldObject have in common."""

    @property
    def kind(self) -> ShapeKind:
        """The kind of volume: "sphere", "capsule", "cylinder", "box" or "convex"."""

    @property
    def size(self) -> tuple[float, ...]:
        """The lengths of the volume [m], as in `mobee.robot.robot.Shape.size`.

        Sphere: radius; capsule and cylinder: radius and height (of a capsule without its caps); box: full edges x, y and z; convex: no
        lengths.
        """

    @property
    def position(self) -> Array:
        """The position of the volume, (3,) m, in the root frame; that of a volume on a link is given for zero pose."""

    @property
    def rotation(self) -> Array:
        """The rotation of the volume, (3, 3), in the root frame; that of a volume on a link is given for zero pose."""


def bound(volume: Volume, vertices: Array | None = None) -> float:
    """Return the radius [m] of the smallest ball centred at a volume's position that contains the volume.

    `vertices`: (v, 3) m, of a convex volume, relative to its position; None for the other kinds.
    """
    if vertices is not None:
        return float(np.sqrt((vertices * vertices).sum(axis=1)).max())
    size = volume.size
    if volume.kind == "box":
        return math.hypot(*size) / 2.0
    radius, half = size[0], size[1] / 2.0 if len(size) > 1 else 0.0
    return math.hypot(radius, half) if volume.kind == "cylinder" else radius + half


def volume_row(volume: Volume) -> Volumes:
    """Return the description of a sphere, capsule, cylinder or box for the core: a 0-dimensional array of the type VOLUME."""
    size = volume.size
    half = [length / 2.0 for length in size] if volume.kind == "box" else [size[0], size[1] / 2.0 if len(size) > 1 else 0.0, 0.0]
    return _row(volume, half, bound(volume))


def convex_row(volume: Volume, vertices: Array, first: int) -> Volumes:
    """Return the description of a convex volume for the core: a 0-dimensional array of the type VOLUME.

    `vertices`: (v, 3) m, relative to its position. `first`: index of the first vertex in the core's table of corners.
    """
    return _row(volume, [first, len(vertices), 0.0], bound(volume, vertices))


def _row(volume: Volume, half: list[float], radius: float) -> Volumes:
    return np.array((CODES[volume.kind], volume.position, volume.rotation, half, radius), dtype=VOLUME)
