"""The light of a picture: from the sky, from the ground, and from one lamp, which casts shadows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from experiments.drawing.camera import Camera, framing
from experiments.drawing.raster import Floats, Raster
from experiments.drawing.solid import Solid
from mobee.arrays import Array

SKY, GROUND, SUN = 0.62, 0.34, 0.50  # light from above, from below, from the lamp
SHADE = 0.75  # share of the lamp's light that its shadow takes
FINER = 2.5  # times the height of the camera's picture is that of the lamp's own
BIAS = 0.004  # m: what is nearer than this to what shades it is that very thing; its points are looked at so far above it
AROUND = ((-1.0, -0.5), (0.5, -1.0), (1.0, 0.5), (-0.5, 1.0))  # pixels of the lamp's picture that are looked at, for soft edges


class Lamp:
    """Hangs above the camera's left shoulder and sees what it lights, as a camera does."""

    def __init__(self, camera: Camera, solids: Sequence[Solid]) -> None:
        self._axes = _axes(camera)
        self._seen = Raster(framing(self._axes, solids, np.empty((0, 3)), round(FINER * camera.height)), solids) if solids else None

    def light(self, points: Floats, normals: Floats) -> Floats:
        """How much of their colour surfaces show, (N,), at points (N, 3) m with normals (N, 3)."""
        facing = np.maximum(-normals @ self._axes[2].astype(np.float32), 0.0)
        sky, sun = 0.5 + 0.5 * normals[:, 2], facing * (1.0 - SHADE * self.shade(points + BIAS * normals))
        found: Floats = GROUND + (SKY - GROUND) * sky + SUN * sun
        return found

    def shade(self, points: Floats) -> Floats:
        """How much of the lamp is hidden from points (N, 3) m, (N,) in 0..1."""
        shade = np.zeros(len(points), np.float32)
        if self._seen is None:
            return shade
        camera, (right, up, ahead) = self._seen.camera, self._axes.astype(np.float32) @ points.T
        column, row = (right - camera.corner[0]) * camera.scale, (camera.corner[1] - up) * camera.scale
        for aside, down in AROUND:
            i, j = np.floor(row + down).astype(np.intp), np.floor(column + aside).astype(np.intp)
            inside = (i >= 0) & (j >= 0) & (i < camera.height) & (j < camera.width)
            i[~inside], j[~inside] = 0, 0
            shade += inside & (self._seen.depth[i, j] < ahead - BIAS)
        return shade / np.float32(len(AROUND))


def _axes(camera: Camera) -> Array:
    """What is right, up and ahead of the lamp, (3, 3)."""
    ahead = 0.55 * camera.axes[0] - 0.25 * camera.axes[1] + 0.75 * camera.axes[2] - np.array([0.0, 0.0, 1.1])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.axes[1])
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, ahead), ahead])
