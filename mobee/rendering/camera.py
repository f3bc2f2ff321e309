# SPDX-License-Identifier: Apache-2.0
"""Cameras of rendered pictures: orthographic (parallel rays, so that the scale is the same at every distance) or perspective."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mobee._core.rays import Rays, cast
from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue, UnknownName
from mobee.rendering.solid import Solid, packed

Floats = NDArray[np.float32]

# Azimuth and elevation of the camera, degrees: 0 is in front of a robot that looks along -x as the iCub does, 90 at its right.
VIEWS = {
    "front": (0.0, 8.0),
    "side": (90.0, 8.0),
    "oblique": (40.0, 25.0),
    "left": (-40.0, 25.0),
    "top": (0.0, 89.0),
    "behind": (140.0, 25.0),
}
MARGIN = 0.03  # m
NOTHING = -1  # in place of a group
NEAREST = 0.03  # m: a perspective camera does not see what is nearer


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera whose picture has width x height pixels.

    Attributes:
        axes: (3, 3), rows are the directions right, up and ahead of the camera, in the root frame.
        corner: (2,) m, upper left corner of the picture: its coordinates along the axes right and up.
        scale: pixels per metre.
        width: columns.
        height: rows.
        eye: (3,) m, root frame, where the rays of a perspective picture begin; corner and scale then belong to the plane 1 m ahead of it.
            None: the camera is orthographic, that is, its rays are parallel.
    """

    axes: Array
    corner: Array
    scale: float
    width: int
    height: int
    eye: Array | None = None

    def finer(self, times: int) -> Camera:
        """Return a camera with the same view and `times` as many pixels in both directions."""
        return replace(self, scale=self.scale * times, width=self.width * times, height=self.height * times)

    def pixels(self, points: Array) -> Array:
        """Return the column and row (..., 2), from the upper left corner, of points (..., 3) m, root frame; orthographic cameras only."""
        flat = points @ self.axes[:2].T - self.corner
        found: Array = self.scale * flat * np.array([1.0, -1.0])
        return found

    def rays(self) -> Rays:
        """Return the rays through the centres of the pixels, in the form that the compiled core reads."""
        axes, step = self.axes * np.array([[1.0], [-1.0], [1.0]]), 1.0 / self.scale
        left, top = float(self.corner[0]) + 0.5 * step, 0.5 * step - float(self.corner[1])
        if self.eye is None:
            return Rays(axes, np.zeros(3), left, top, step, self.height, self.width, False, -np.inf)
        return Rays(axes, self.eye, left, top, step, self.height, self.width, True, NEAREST)


def eye_camera(position: Array, axes: Array, width: int, height: int, view_deg: float) -> Camera:
    """Return the perspective camera at `position` (3,) m, root frame.

    `axes`: (3, 3), rows are the directions right, up and ahead. `view_deg`: vertical field of view [degrees]. `width`, `height`: pixels.
    """
    scale = 0.5 * height / float(np.tan(0.5 * np.deg2rad(view_deg)))
    return Camera(axes, np.array([-0.5 * width, 0.5 * height]) / scale, scale, width, height, position)


def camera_axes(view: str | tuple[float, float]) -> Array:
    """Return the axes of a camera, (3, 3), rows right, up and ahead, for a view.

    `view`: a name in VIEWS, or azimuth and elevation [degrees]; azimuth 0 is in front of a robot that looks along -x, as the iCub does, and
    90 is at its right. Raises UnknownName for an unknown name, InvalidValue for other angles.
    """
    if isinstance(view, str):
        if view not in VIEWS:
            raise UnknownName("view", view, VIEWS)
        view = VIEWS[view]
    angles = real_array("view", view)
    if angles.shape != (2,) or not np.isfinite(angles).all():
        raise InvalidValue(f"view {view!r}: must be azimuth and elevation, two finite numbers [degrees], or one of {', '.join(VIEWS)}.")
    a, e = np.deg2rad(angles)
    ahead = np.array([np.cos(a) * np.cos(e), -np.sin(a) * np.cos(e), -np.sin(e)])
    right = np.array([-np.sin(a), -np.cos(a), 0.0])
    return np.array([right, np.cross(right, ahead), ahead])


def framing(axes: Array, solids: Sequence[Solid], points: Array, height: int, margin: float = MARGIN) -> Camera:
    """Return the orthographic camera whose picture shows all solids and points (P, 3) m, root frame, with a margin around them.

    `axes`: (3, 3), rows right, up and ahead of the camera. `height`: rows of the picture. `margin`: m.
    """
    seen = [points @ axes[:2].T] if len(points) else []
    for sign in (1.0, -1.0):
        if solids:
            seen.append(np.array([[solid.position @ axis + sign * solid.extent(sign * axis) for axis in axes[:2]] for solid in solids]))
    low, high = np.min([flat.min(axis=0) for flat in seen], axis=0) - margin, np.max([flat.max(axis=0) for flat in seen], axis=0) + margin
    scale = height / float(high[1] - low[1])
    return Camera(axes, np.array([low[0], high[1]]), scale, max(1, int(np.ceil(scale * (high[0] - low[0])))), height)


class Raster:
    """The nearest surface in each pixel of a picture of H x W pixels.

    Attributes:
        depth: (H, W) m along the camera's axis, from the eye or, with parallel rays, from the root frame's origin; infinite where there is
            nothing.
        normal: (H, W, 3), of the surface, root frame.
        which: (H, W), index of the solid in the constructor's argument `solids`; -1 where there is nothing.
        group: (H, W), `Solid.group` of the solid: solids with the same number have no outline between them. -1 where there is nothing.
        color: (H, W, 3), of the solid, 0 to 1.
    """

    def __init__(self, camera: Camera, solids: Sequence[Solid] = ()) -> None:
        self.camera = camera
        packs = packed(solids)
        self.depth, which, self.normal = cast(packs.volumes, packs.surfaces, camera.rays())
        self.which = np.array([*packs.numbers, NOTHING], np.int32)[which]
        groups = np.array([*(solid.group for solid in solids), NOTHING])
        colors = np.array([*(solid.color for solid in solids), (0.0, 0.0, 0.0)], np.float32)
        self.group: NDArray[np.int64] = groups[self.which]
        self.color: Floats = colors[self.which]

    def points(self) -> Floats:
        """Return the visible surface points (N, 3) m, root frame, one for each pixel that shows a surface; orthographic cameras only."""
        return places(self.camera, self.depth, np.isfinite(self.depth))


def places(camera: Camera, depth: Floats, which: NDArray[np.bool_]) -> Floats:
    """Return the points (N, 3) m, root frame, that the pixels `which` (H, W) of an orthographic camera show at the depths (H, W) m."""
    right, up = pixel_middles(camera)
    rows, columns = np.nonzero(which)
    found: Floats = np.stack([right[columns], up[rows], depth[which]], axis=1) @ camera.axes.astype(np.float32)
    return found


def pixel_middles(camera: Camera) -> tuple[Floats, Floats]:
    """Return the coordinates of the pixels' centres: of the columns, (W,) m, and of the rows from top to bottom, (H,) m.

    The first are measured along the camera's axis right, the second along its axis up. The origin is that of the root frame; for a
    perspective camera it is the point 1 m ahead of the eye.
    """
    right = camera.corner[0] + (np.arange(camera.width) + 0.5) / camera.scale
    up = camera.corner[1] - (np.arange(camera.height) + 0.5) / camera.scale
    return right.astype(np.float32), up.astype(np.float32)
