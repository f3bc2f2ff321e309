# SPDX-License-Identifier: Apache-2.0
"""Finds red balls in a picture: finds red regions, then fits to each outline the cone of rays that touch a sphere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.vision.lens import Lens
from mobee.vision.regions import border, boxes, checked_picture, label, without_holes

Picture = NDArray[np.uint8]

MAX_HUE, MIN_SATURATION, MIN_VALUE = 16.0, 0.51, 50  # degrees from red; of 1; of 255
MIN_AREA = 40.0  # px
INLIER, OUTSIDE = 1.0, 2.0  # px from the outline: largest distance of an inlier; smallest distance of a point that is not on the ball
MIN_ARC = 0.6  # share of the outline that must be visible
MAX_OUTSIDE = 0.1  # share of the blob's border that may be outside of the outline
FIT_ROUNDS = 8
SECTORS = 36
BORDER_INSET = 0.5  # px: the centres of border pixels lie half a pixel inside the outline


@dataclass(frozen=True, slots=True, eq=False)
class Sighting:
    """A ball in one picture, in the camera's frame: x right, y down, z forward.

    `direction`: (3,) unit vector to the centre of the ball. `half_angle`: half angle [rad] of the cone of rays that touch the ball. `arc`:
    share of the outline that is visible, 0 to 1.
    """

    direction: Array
    half_angle: float
    arc: float

    def distance(self, radius: float) -> float:
        """Return the distance [m] of the ball's centre from the camera, if the ball has this `radius` [m]."""
        return radius / math.sin(self.half_angle)


def find_balls(picture: Picture, intrinsics: Array, distortion: Sequence[float] = ()) -> list[Sighting]:
    """Find every round red object in a picture (height, width, 3) of bytes red, green, blue; return them with the largest first.

    `intrinsics`: (3, 3) px, the camera's matrix. `distortion`: the coefficients k1 k2 p1 p2 of the lens (Brown and Conrady), or empty.

    The outline of a sphere is an ellipse whose centre is not the image of the sphere's centre, but its rays form a circular cone about the
    ray to the centre. The cone is fitted, so perspective causes no bias. Points where another object hides the ball are ignored. Raises
    InvalidValue for a picture of another type, such as a grey one, and for a matrix of another shape.
    """
    height, width = checked_picture(picture).shape[:2]
    if np.shape(intrinsics) != (3, 3):
        raise InvalidValue(f"intrinsics of shape {np.shape(intrinsics)}: must be the camera's matrix (3, 3), as `lens.matrix`.")
    found = []
    for edge, area in _red_blobs(picture):
        inner = (edge > 0).all(axis=1) & (edge < (width - 1, height - 1)).all(axis=1)
        if area >= MIN_AREA and inner.sum() >= 12:
            sighting = _fit(_rays(edge[inner], intrinsics, distortion), float(intrinsics[0, 0]))
            if sighting is not None:
                found.append(sighting)
    return sorted(found, key=lambda s: -s.half_angle)


def _red_blobs(picture: Picture) -> list[tuple[Array, float]]:
    """Return the border pixels, (m, 2) as column and row, and the area [px] of each connected red region; holes are filled.

    Regions of less than MIN_AREA pixels are ignored.
    """
    regions = label(_red_pixels(picture), diagonal=True)
    blobs = []
    for number, where in enumerate(boxes(regions), start=1):
        if regions[where].size < MIN_AREA:
            continue
        region = without_holes(regions[where] == number)
        if region.sum() < MIN_AREA:
            continue
        edge = np.argwhere(border(region))
        # Of the polygon through the centres of the border's pixels, by Pick's theorem.
        area = float(region.sum() - 0.5 * len(edge) - 1.0)
        blobs.append(((edge + (where[0].start, where[1].start))[:, ::-1].astype(np.float64), area))
    return blobs


def _red_pixels(picture: Picture) -> NDArray[np.bool_]:
    """Return whether each pixel (height, width) is red, by hue, saturation and value."""
    red, green, blue = np.ascontiguousarray(picture.transpose(2, 0, 1))
    is_red = (red >= MIN_VALUE) & (red > green) & (red > blue)  # on bytes: most pixels fail here
    value, green, blue = (channel[is_red].astype(np.float64) for channel in (red, green, blue))
    spread = value - np.minimum(green, blue)
    is_red[is_red] = (spread >= MIN_SATURATION * value) & (60.0 * np.abs(green - blue) <= MAX_HUE * spread)
    return np.asarray(is_red, dtype=np.bool_)


def _rays(points: Array, intrinsics: Array, distortion: Sequence[float]) -> Array:
    """Return unit vectors (m, 3) from the camera through pixels (m, 2)."""
    if len(distortion):
        return Lens.of_matrix(intrinsics, np.asarray(distortion)).unproject(points)
    homogeneous = np.column_stack([points, np.ones(len(points))])
    rays = np.linalg.solve(intrinsics, homogeneous.T).T
    return np.asarray(rays / np.linalg.norm(rays, axis=1, keepdims=True), dtype=np.float64)


def _fit(rays: Array, focal: float) -> Sighting | None:
    """Return the ball whose cone fits the rays (m, 3) through a border; None if the border is not that of a ball."""
    keep = np.ones(len(rays), dtype=bool)
    for _ in range(FIT_ROUNDS):
        direction, half_angle = _cone(rays[keep])
        error = focal * (np.arccos(np.clip(rays @ direction, -1.0, 1.0)) - half_angle)  # px
        chosen = np.abs(error) <= max(INLIER, 1.5 * float(np.median(np.abs(error))))
        if (chosen == keep).all() or chosen.sum() < 8:
            break
        keep = chosen
    arc = _arc(rays[np.abs(error) <= INLIER], direction)
    if arc < MIN_ARC or np.mean(error > OUTSIDE) > MAX_OUTSIDE:
        return None
    return Sighting(direction, half_angle + BORDER_INSET / focal, arc)


def _cone(rays: Array) -> tuple[Array, float]:
    """Return axis (3,) and half angle [rad] of the cone nearest to unit rays r (m, 3): w.r = 1 with w = axis / cos(angle)."""
    w = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)[0]
    length = float(np.linalg.norm(w))
    return np.asarray(w / length, dtype=np.float64), math.acos(min(1.0, 1.0 / length))


def _arc(rays: Array, direction: Array) -> float:
    """Return how much of a circle an outline covers: the share of SECTORS equal sectors around `direction` that contain a ray, 0 to 1.

    `rays`: (m, 3) unit vectors from the camera to points of the outline. `direction`: (3,) unit vector to the middle of the circle.
    """
    side = np.cross(direction, (0.0, 1.0, 0.0))
    up = np.cross(direction, side)
    around = np.arctan2(rays @ up, rays @ side)
    return len(np.unique(np.floor(SECTORS * (around + np.pi) / (2.0 * np.pi)).astype(int) % SECTORS)) / SECTORS
