"""A picture of solids: lit from above, with shadows on themselves and on the floor, outlines, and soft edges."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter

from experiments.drawing.camera import Camera
from experiments.drawing.lamp import Lamp
from experiments.drawing.raster import NOTHING, Floats, Raster, along, cast, places
from experiments.drawing.solid import Solid

Picture = NDArray[np.uint8]  # (H, W, 3), red, green, blue

FINER = 3  # rays a pixel, in each direction
CAST, BLUR = 0.20, 0.006  # how dark shadows on the floor are, and how wide their edges [m]
STEP, FOLD = 0.012, 0.65  # outlines: where depths of neighbours differ that much [m], or the cosine between their normals is less
LINE, FAINT = 0.45, 0.20  # how dark outlines are, and those of folds
HOLLOW, WIDE, DEEP = 0.35, 0.02, 0.06  # how dark it is behind something, within how much around [m], and how far behind it at most [m]


def draw(solids: Sequence[Solid], camera: Camera, floor: float | None = None, finer: int = FINER) -> Picture:
    """Draw them as a camera sees them; `floor`: m, the height on which shadows fall, None without."""
    lamp = Lamp(camera, [solid for solid in solids if solid.opacity >= 1.0 and not solid.veiled])
    seen = Raster(camera.finer(finer), [solid for solid in solids if solid.opacity >= 1.0])
    picture = _fine(_floor(camera, lamp, floor), finer)
    something = np.isfinite(seen.depth)
    picture[something] = seen.color[something] * lamp.light(seen.points(), seen.normal[something])[:, None]
    picture *= 1.0 - HOLLOW * _fine(_hollows(seen, camera, finer), finer)[..., None]
    picture *= 1.0 - _outlines(seen)[..., None]
    for solid in sorted((one for one in solids if one.opacity < 1.0), key=lambda one: -float(camera.axes[2] @ one.position)):
        _glaze(picture, seen, solid)
    for veil in sorted({solid.veiled for solid in solids} - {0.0}):
        _unveil(picture, seen, [solid for solid in solids if solid.veiled == veil], veil)
    return (255.0 * np.clip(_coarse(picture, finer), 0.0, 1.0) + 0.5).astype(np.uint8)


def _fine(values: Floats, times: int) -> Floats:
    found: Floats = values.repeat(times, axis=0).repeat(times, axis=1)
    return found


def _coarse(values: Floats, times: int) -> Floats:
    found: Floats = values.reshape(values.shape[0] // times, times, values.shape[1] // times, times, *values.shape[2:]).mean(axis=(1, 3))
    return found


def _floor(camera: Camera, lamp: Lamp, height: float | None) -> Floats:
    """White paper, with the shadow on the floor if it is seen from above."""
    picture = np.ones((camera.height, camera.width, 3), np.float32)
    steep = float(camera.axes[2][2])
    if height is None or steep > -0.05:
        return picture
    up = along(camera)[1]
    depth = np.broadcast_to(((height - up * camera.axes[1][2]) / steep).astype(np.float32)[:, None], picture.shape[:2])
    shade = lamp.shade(places(camera, depth, np.ones(depth.shape, bool))).reshape(depth.shape)
    return picture * (1.0 - CAST * gaussian_filter(shade, BLUR * camera.scale))[..., None].astype(np.float32)


def _outlines(seen: Raster) -> Floats:
    """How dark pixels are for being where something begins, (H, W): another group or depth, or a fold."""
    lines = np.zeros(seen.depth.shape, np.float32)
    for first, second in ((np.s_[:-1], np.s_[1:]), (np.s_[:, :-1], np.s_[:, 1:])):
        with np.errstate(invalid="ignore"):  # between two pixels of nothing
            jump = np.abs(seen.depth[first] - seen.depth[second]) > STEP
        edge = jump | (seen.group[first] != seen.group[second])
        fold = (seen.group[first] != NOTHING) & (np.einsum("ijk,ijk->ij", seen.normal[first], seen.normal[second]) < FOLD)
        dark = np.where(edge, np.float32(LINE), FAINT * fold.astype(np.float32))
        for part in (lines[first], lines[second]):
            np.maximum(part, dark, out=part)
    return lines


def _hollows(seen: Raster, camera: Camera, finer: int) -> Floats:
    """How far behind what surrounds it each surface is, (H, W) of the coarse picture, in 0..1."""
    something = np.isfinite(seen.depth)
    weight = _coarse(something.astype(np.float32), finer)
    depth = _coarse(np.where(something, seen.depth, np.float32(0.0)), finer)
    wide = WIDE * camera.scale
    around = gaussian_filter(depth, wide) / np.maximum(gaussian_filter(weight, wide), 1e-3)
    found: Floats = np.where(weight > 0.99, np.clip((depth - around) / DEEP, 0.0, 1.0), 0.0).astype(np.float32)
    return found


def _glaze(picture: Floats, seen: Raster, solid: Solid) -> None:
    """Lay a solid that is seen through over what is behind it: denser towards its rim."""
    window, depth, normal = cast(seen.camera, solid)
    facing = np.abs(normal @ seen.camera.axes[2].astype(np.float32))
    opacity = (np.clip(solid.opacity * (1.5 - facing), 0.0, 1.0) * (depth < seen.depth[window]))[..., None]
    color = np.array(solid.color, np.float32) * (0.75 + 0.25 * normal[..., 2:])
    picture[window] = picture[window] * (1.0 - opacity) + color * opacity


def _unveil(picture: Floats, seen: Raster, solids: Sequence[Solid], veil: float) -> None:
    """Let those shine through what hides them."""
    alone = Raster(seen.camera, solids)
    hidden = np.isfinite(alone.depth) & (alone.depth > seen.depth)
    picture[hidden] = (1.0 - veil) * picture[hidden] + veil * alone.color[hidden]
