"""The two layouts that the whole engine shares: a volume's row, as it is described, and its slot, as it is placed in a pose."""

from __future__ import annotations

import math
from typing import Protocol

import numpy as np

from mobee.robot.robot import Array, ShapeKind

SPHERE, CAPSULE, CYLINDER, BOX, CONVEX = range(5)
CODES: dict[ShapeKind, int] = {"sphere": SPHERE, "capsule": CAPSULE, "cylinder": CYLINDER, "box": BOX, "convex": CONVEX}

# A row: kind, position (3), rotation (9, row-major), half sizes (3), radius of the enclosing sphere about the position.
ROW_KIND, ROW_POSITION, ROW_ROTATION, ROW_HALF, ROW_BOUND = 0, 1, 4, 13, 16
ROW = 17

# A slot of a pose, root frame: centre (3), rotation (9, row-major), half sizes (3), half core segment (3), radius about the core,
# radius of the enclosing sphere, kind, square of the half core's length and its inverse (0 without a core).  Half sizes: sphere
# (r, 0, 0); capsule and cylinder (r, half height, 0); box half edges; convex (first vertex, number of vertices, 0).  The core is
# the axis of a capsule or cylinder.
CENTER, ROTATION, HALF, CORE, RADIUS, BOUND, KIND, LENGTH, INVERSE = 0, 3, 12, 15, 18, 19, 20, 21, 22
SLOT = 24  # 23 used; three cache lines


class Volume(Protocol):
    """What a robot's Shape and a WorldObject have in common."""

    @property
    def kind(self) -> ShapeKind: ...  # noqa: D102
    @property
    def size(self) -> tuple[float, ...]: ...  # noqa: D102
    @property
    def position(self) -> Array: ...  # noqa: D102
    @property
    def rotation(self) -> Array: ...  # noqa: D102


def volume_row(volume: Volume) -> Array:
    """The row (ROW,) of a sphere, capsule, cylinder or box; a convex one needs its vertices, see `convex_row`."""
    row = np.zeros(ROW)
    row[ROW_KIND] = CODES[volume.kind]
    row[ROW_POSITION : ROW_POSITION + 3] = volume.position
    row[ROW_ROTATION : ROW_ROTATION + 9] = np.asarray(volume.rotation).reshape(9)
    size = volume.size
    if volume.kind == "box":
        row[ROW_HALF : ROW_HALF + 3] = np.array(size) / 2.0
        row[ROW_BOUND] = math.hypot(*size) / 2.0
        return row
    radius, half = size[0], size[1] / 2.0 if len(size) > 1 else 0.0
    row[ROW_HALF : ROW_HALF + 2] = radius, half
    row[ROW_BOUND] = math.hypot(radius, half) if volume.kind == "cylinder" else radius + half
    return row


def convex_row(volume: Volume, vertices: Array, first: int) -> Array:
    """The row (ROW,) of a convex volume whose vertices (v, 3) m stand from `first` on in the engine's table of vertices."""
    row = np.zeros(ROW)
    row[ROW_KIND] = CONVEX
    row[ROW_POSITION : ROW_POSITION + 3] = volume.position
    row[ROW_ROTATION : ROW_ROTATION + 9] = np.asarray(volume.rotation).reshape(9)
    row[ROW_HALF : ROW_HALF + 2] = first, len(vertices)
    row[ROW_BOUND] = float(np.sqrt((vertices * vertices).sum(axis=1)).max())
    return row
