"""What is nearest in each pixel of a picture: a z-buffer, filled by rays through convex volumes."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from experiments.drawing.camera import Camera
from experiments.drawing.rays import entered
from experiments.drawing.solid import Solid

Floats = NDArray[np.float32]
NOTHING = -1  # instead of a group


class Raster:
    """The picture of a camera: per pixel how far ahead the nearest surface is, its normal, colour and group.

    `depth`: (H, W) m along the camera's axis, from the root frame's origin; infinite where there is nothing.  `normal`, `color`: (H, W, 3),
    root frame.  `group`: (H, W), -1 where there is nothing.
    """

    def __init__(self, camera: Camera, solids: Iterable[Solid] = ()) -> None:
        shape = camera.height, camera.width
        self.camera = camera
        self.depth: Floats = np.full(shape, np.inf, np.float32)
        self.normal: Floats = np.zeros((*shape, 3), np.float32)
        self.color: Floats = np.zeros((*shape, 3), np.float32)
        self.group = np.full(shape, NOTHING)
        for solid in solids:
            self.add(solid)

    def add(self, solid: Solid) -> None:
        """Draw a solid: it is seen where nothing drawn before is nearer."""
        window, depth, normal = cast(self.camera, solid)
        nearer = depth < self.depth[window]
        self.depth[window][nearer] = depth[nearer]
        self.normal[window][nearer] = normal[nearer]
        self.color[window][nearer] = solid.color
        self.group[window][nearer] = solid.group

    def points(self) -> Floats:
        """The places of what is seen, (N, 3) m in the root frame, pixel by pixel where there is something."""
        return places(self.camera, self.depth, np.isfinite(self.depth))


def cast(camera: Camera, solid: Solid) -> tuple[tuple[slice, slice], Floats, Floats]:
    """The pixels around a solid, and there depth (h, w) m, infinite beside it, and normal (h, w, 3), root frame."""
    window = _window(camera, solid)
    rows, columns = (np.arange(part.start, part.stop) + 0.5 for part in window)
    right = (camera.corner[0] + columns / camera.scale - camera.axes[0] @ solid.position).astype(np.float32)
    up = (camera.corner[1] - rows / camera.scale - camera.axes[1] @ solid.position).astype(np.float32)
    own = (camera.axes @ solid.rotation).astype(np.float32)  # the camera's axes in the solid's
    starts = own[0][:, None, None] * right + own[1][:, None, None] * up[:, None]
    ahead, normal = entered(solid, starts, camera.axes[2] @ solid.rotation)
    depth = (ahead + camera.axes[2] @ solid.position).astype(np.float32)
    return window, depth, np.moveaxis(normal, 0, -1) @ solid.rotation.T.astype(np.float32)


def places(camera: Camera, depth: Floats, which: NDArray[np.bool_]) -> Floats:
    """The points (N, 3) m, root frame, at a depth (H, W) m in those of its pixels."""
    right, up = along(camera)
    rows, columns = np.nonzero(which)
    found: Floats = np.stack([right[columns], up[rows], depth[which]], axis=1) @ camera.axes.astype(np.float32)
    return found


def along(camera: Camera) -> tuple[Floats, Floats]:
    """How far right each column of pixels is, (W,) m, and how far up each row, (H,) m."""
    right = camera.corner[0] + (np.arange(camera.width) + 0.5) / camera.scale
    up = camera.corner[1] - (np.arange(camera.height) + 0.5) / camera.scale
    return right.astype(np.float32), up.astype(np.float32)


def _window(camera: Camera, solid: Solid) -> tuple[slice, slice]:
    """Rows and columns within which a solid is seen."""
    middle = camera.pixels(solid.position)
    right, up = camera.axes[:2]
    column = middle[0] + camera.scale * np.array([-solid.reach(-right), solid.reach(right)])
    row = middle[1] + camera.scale * np.array([-solid.reach(up), solid.reach(-up)])
    return _within(row, camera.height), _within(column, camera.width)


def _within(span: NDArray[np.float64], size: int) -> slice:
    first, last = np.clip([np.floor(span[0]), np.ceil(span[1])], 0, size).astype(int)
    return slice(int(first), int(last))
