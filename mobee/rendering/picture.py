# SPDX-License-Identifier: Apache-2.0
"""Draws solids with parallel rays: lit from above, with shadows on themselves and on the floor, outlines, and smooth edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.rendering.camera import NOTHING, Camera, Floats, Raster, framing, pixel_middles, places
from mobee.rendering.palette import Color
from mobee.rendering.solid import Solid

Picture = NDArray[np.uint8]  # (H, W, 3), red, green, blue

WHITE: Color = (255, 255, 255)
RAYS = 3  # a pixel, in each direction
SKY_LIGHT, GROUND_LIGHT, LAMP_LIGHT = 0.62, 0.34, 0.50  # from above, from below, from the lamp
SHADOW = 0.75  # share of the lamp's light that is missing in its shadow
LAMP_SCALE = 2.5  # times the height of the camera's picture is that of the lamp's own
SHADOW_BIAS = 0.004  # m: points are tested for shadow this far above their surface, so that the surface casts none on itself
SHADOW_SAMPLES = ((-1.0, -0.5), (0.5, -1.0), (1.0, 0.5), (-0.5, 1.0))  # pixels of the lamp's picture, for smooth edges
FLOOR_SHADOW, FLOOR_BLUR = 0.20, 0.006  # how dark shadows on the floor are, and how wide their edges [m]
DEPTH_STEP, FOLD_COSINE = 0.012, 0.65  # an outline: where neighbours' depths differ more [m]; a fold: where their normals' cosine is less
OUTLINE, FOLD_LINE = 0.45, 0.20  # how dark outlines and folds are
HOLLOW, HOLLOW_WIDTH, HOLLOW_DEPTH = 0.35, 0.02, 0.06  # how dark it is behind something, within that width [m], full at that depth [m]


def draw(solids: Sequence[Solid], camera: Camera, floor: float | None = None, rays: int = RAYS, ground: Color = WHITE) -> Picture:
    """Draw solids as a camera with parallel rays sees them; return the picture (height, width, 3), bytes red, green, blue.

    `floor`: height of the floor on which shadows fall [m]; None: no floor. `rays`: each pixel is the mean of `rays` x `rays` rays.
    `ground`: the colour behind all solids, 8-bit red, green, blue.
    """
    lamp = _Lamp(camera, [solid for solid in solids if solid.opacity >= 1.0 and not solid.veiled])
    seen = Raster(camera.finer(rays), [solid for solid in solids if solid.opacity >= 1.0])
    picture = _fine(_floor(camera, lamp, floor, ground), rays)
    something = np.isfinite(seen.depth)
    picture[something] = seen.color[something] * lamp.light(seen.points(), seen.normal[something])[:, None]
    picture *= 1.0 - HOLLOW * _fine(_hollows(seen, camera, rays), rays)[..., None]
    picture *= 1.0 - _outlines(seen)[..., None]
    for solid in sorted((one for one in solids if one.opacity < 1.0), key=lambda one: -float(camera.axes[2] @ one.position)):
        _draw_transparent(picture, seen, solid)
    for veil in sorted({solid.veiled for solid in solids} - {0.0}):
        _draw_veiled(picture, seen, [solid for solid in solids if solid.veiled == veil], veil)
    return (255.0 * np.clip(_coarse(picture, rays), 0.0, 1.0) + 0.5).astype(np.uint8)


class _Lamp:
    """A lamp above and to the left of the camera; it lights the surfaces that a camera at its position would see."""

    def __init__(self, camera: Camera, solids: Sequence[Solid]) -> None:
        self._axes = _lamp_axes(camera)
        height = round(LAMP_SCALE * camera.height)
        self._seen = Raster(framing(self._axes, solids, np.empty((0, 3)), height), solids) if solids else None

    def light(self, points: Floats, normals: Floats) -> Floats:
        """Return the brightness (N,) of surfaces at points (N, 3) m with normals (N, 3)."""
        facing = np.maximum(-normals @ self._axes[2].astype(np.float32), 0.0)
        sky, lamp = 0.5 + 0.5 * normals[:, 2], facing * (1.0 - SHADOW * self.shade(points + SHADOW_BIAS * normals))
        found: Floats = GROUND_LIGHT + (SKY_LIGHT - GROUND_LIGHT) * sky + LAMP_LIGHT * lamp
        return found

    def shade(self, points: Floats) -> Floats:
        """Return the share (N,) of the lamp's light that does not arrive at points (N, 3) m."""
        shade = np.zeros(len(points), np.float32)
        if self._seen is None:
            return shade
        camera, (right, up, ahead) = self._seen.camera, self._axes.astype(np.float32) @ points.T
        column, row = (right - camera.corner[0]) * camera.scale, (camera.corner[1] - up) * camera.scale
        for aside, down in SHADOW_SAMPLES:
            i, j = np.floor(row + down).astype(np.intp), np.floor(column + aside).astype(np.intp)
            inside = (i >= 0) & (j >= 0) & (i < camera.height) & (j < camera.width)
            i[~inside], j[~inside] = 0, 0
            shade += inside & (self._seen.depth[i, j] < ahead - SHADOW_BIAS)
        return shade / np.float32(len(SHADOW_SAMPLES))


def _lamp_axes(camera: Camera) -> Array:
    """Return the lamp's axes (3, 3): rows are right, up and ahead."""
    ahead = 0.55 * camera.axes[0] - 0.25 * camera.axes[1] + 0.75 * camera.axes[2] - np.array([0.0, 0.0, 1.1])
    ahead /= np.linalg.norm(ahead)
    right = np.cross(ahead, camera.axes[1])
    right /= np.linalg.norm(right)
    return np.array([right, np.cross(right, ahead), ahead])


def _fine(values: Floats, times: int) -> Floats:
    found: Floats = values.repeat(times, axis=0).repeat(times, axis=1)
    return found


def _coarse(values: Floats, times: int) -> Floats:
    found: Floats = values.reshape(values.shape[0] // times, times, values.shape[1] // times, times, *values.shape[2:]).mean(axis=(1, 3))
    return found


def _floor(camera: Camera, lamp: _Lamp, height: float | None, ground: Color) -> Floats:
    """Return a background of one colour, with the shadow on the floor if the camera sees the floor from above."""
    picture = np.tile(np.array(ground, np.float32) / np.float32(255.0), (camera.height, camera.width, 1))
    steep = float(camera.axes[2][2])
    if height is None or steep > -0.05:
        return picture
    from scipy.ndimage import gaussian_filter

    up = pixel_middles(camera)[1]
    depth = np.broadcast_to(((height - up * camera.axes[1][2]) / steep).astype(np.float32)[:, None], picture.shape[:2])
    shade = lamp.shade(places(camera, depth, np.ones(depth.shape, bool))).reshape(depth.shape)
    picture *= (1.0 - FLOOR_SHADOW * gaussian_filter(shade, FLOOR_BLUR * camera.scale))[..., None].astype(np.float32)
    return picture


def _outlines(seen: Raster) -> Floats:
    """Return the darkness of outlines in each pixel, (H, W): lines are where the group, the depth or the surface direction changes."""
    lines = np.zeros(seen.depth.shape, np.float32)
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        with np.errstate(invalid="ignore"):  # between two pixels of nothing
            step = np.abs(seen.depth[first] - seen.depth[second]) > DEPTH_STEP
        edge = step | (seen.group[first] != seen.group[second])
        fold = (seen.group[first] != NOTHING) & (np.einsum("ijk,ijk->ij", seen.normal[first], seen.normal[second]) < FOLD_COSINE)
        dark = np.where(edge, np.float32(OUTLINE), FOLD_LINE * fold.astype(np.float32))
        for part in (lines[first], lines[second]):
            np.maximum(part, dark, out=part)
    return lines


def _hollows(seen: Raster, camera: Camera, times: int) -> Floats:
    """Return how far each surface is behind its surroundings, in 0..1, (H, W) of the coarse picture; used to darken hollows."""
    from scipy.ndimage import gaussian_filter  # 0.3 s, and only pictures with shadows need it

    something = np.isfinite(seen.depth)
    weight = _coarse(something.astype(np.float32), times)
    depth = _coarse(np.where(something, seen.depth, np.float32(0.0)), times)
    width = HOLLOW_WIDTH * camera.scale
    around = gaussian_filter(depth, width) / np.maximum(gaussian_filter(weight, width), 1e-3)
    found: Floats = np.where(weight > 0.99, np.clip((depth - around) / HOLLOW_DEPTH, 0.0, 1.0), 0.0).astype(np.float32)
    return found


def _draw_transparent(picture: Floats, seen: Raster, solid: Solid) -> None:
    """Blend a transparent solid over the picture behind it: denser towards its rim."""
    alone = Raster(seen.camera, [solid])
    here = alone.depth < seen.depth
    normal = alone.normal[here]
    facing = np.abs(normal @ seen.camera.axes[2].astype(np.float32))
    opacity = np.clip(solid.opacity * (1.5 - facing), 0.0, 1.0)[:, None]
    color = np.array(solid.color, np.float32) * (0.75 + 0.25 * normal[:, 2:])
    picture[here] = picture[here] * (1.0 - opacity) + color * opacity


def _draw_veiled(picture: Floats, seen: Raster, solids: Sequence[Solid], veil: float) -> None:
    """Let `solids` be visible through the opaque solids in front of them, by changing `picture` in place.

    `veil`: share of their colour there, 0 (hidden) to 1 (as if nothing were in front).
    """
    alone = Raster(seen.camera, solids)
    hidden = np.isfinite(alone.depth) & (alone.depth > seen.depth)
    picture[hidden] = (1.0 - veil) * picture[hidden] + veil * alone.color[hidden]
