# SPDX-License-Identifier: Apache-2.0
"""Aligns a flat pattern with a picture to a few hundredths of a pixel: Lucas and Kanade's method, including the distortion of the lens."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array
from mobee.vision.lens import Lens

STEPS, ENOUGH = 20, 5e-3  # of Gauss and Newton; px by which a corner still moves
FARTHEST = 2.5  # px by which a corner may move
LEAST_LIKENESS = 0.85  # correlation of pattern and picture
SMOOTH = 0.3  # px, standard deviation of the filter of the picture
BLUR = 0.65  # px, of the edges in it: those of that filter, of a pixel's area twice, and of linear interpolation
PER_CELL = 6  # samples of a pattern along one side of a cell


def aligned(gray: NDArray[np.float32], lens: Lens, pattern: Array, margin: int, corners: Array) -> Array | None:
    """Return the exact corners (4, 2) px of a flat pattern in a grey picture, from corners that are wrong by a pixel or two.

    The pattern is a plane seen in perspective; its brightness and contrast are fitted too. None if the pattern does not fit the picture, or
    if a corner would move by more than 2.5 px.

    Args:
        gray: (height, width), the picture.
        lens: lens of the camera.
        pattern: (c, c), the brightness of square cells.
        margin: width of the border of `pattern`, in cells; the result is the corners of the square inside this border.
        corners: (4, 2) px, first values of the corners, column and row, clockwise from the upper left.
    """
    from scipy.ndimage import gaussian_filter, map_coordinates  # 0.3 s, and only the alignment needs it

    height, width = gray.shape
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - 12, 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + 12, (width, height))
    patch = gaussian_filter(gray[low[1] : high[1], low[0] : high[0]].astype(np.float64), SMOOTH)
    slopes = np.gradient(patch)
    side = np.linalg.norm(corners - np.roll(corners, 1, axis=0), axis=1).mean()
    points, wanted = _samples(pattern, margin, BLUR * (len(pattern) - 2 * margin) / side)
    plane = _plane_through(lens.undistort((corners - (lens.cx, lens.cy)) / (lens.fx, lens.fy)))
    focal, centre = np.array([lens.fx, lens.fy]), np.array([lens.cx, lens.cy])
    here = _pixels(lens, plane, _SQUARE)
    likeness = 0.0
    for _ in range(STEPS):
        flat, by_plane = _through(plane, points)
        at = (lens.distort(flat) * focal + centre - low)[:, ::-1].T
        if not np.isfinite(at).all() or (at < 0).any() or (at >= np.array(patch.shape)[:, None] - 1).any():
            return None
        seen = map_coordinates(patch, at, order=1)
        gradient = np.stack([map_coordinates(slope, at, order=1) for slope in slopes[::-1]], axis=1)
        by_flat = np.einsum("ki,kij->kj", gradient * focal, lens.distortion_slope(flat))
        scale, offset = np.polyfit(wanted, seen, 1)
        likeness = float(np.corrcoef(wanted, seen)[0, 1])
        by_all = np.column_stack([np.einsum("kj,kjl->kl", by_flat, by_plane), -wanted, -np.ones(len(wanted))])
        step = np.linalg.lstsq(by_all, scale * wanted + offset - seen, rcond=None)[0]
        plane = plane + step[:8]
        before, here = here, _pixels(lens, plane, _SQUARE)
        if not np.isfinite(here).all() or np.abs(here - corners).max() > FARTHEST:
            return None
        if np.abs(here - before).max() < ENOUGH:
            break
    return here if likeness >= LEAST_LIKENESS else None


_SQUARE = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def _samples(pattern: Array, margin: int, blur: float) -> tuple[Array, Array]:
    """Return points (K, 2) in the plane of a pattern, whose square is [-1, 1] x [-1, 1], and the brightness there (K,).

    `blur`: standard deviation of the filter that makes the edges as soft as the picture's, in cells.
    """
    from scipy.ndimage import gaussian_filter

    count = len(pattern)
    fine = np.kron(pattern, np.ones((PER_CELL, PER_CELL)))
    fine = gaussian_filter(fine, blur * PER_CELL, mode="nearest")
    half = 1.0 + 2.0 * margin / (count - 2 * margin)
    along = half * ((np.arange(count * PER_CELL) + 0.5) * 2.0 / (count * PER_CELL) - 1.0)
    x, y = np.meshgrid(along, along)
    edge = PER_CELL // 2  # beyond the outer half cell is what is behind the tag
    inner = np.s_[edge:-edge, edge:-edge]
    return np.column_stack([x[inner].ravel(), y[inner].ravel()]), fine[inner].ravel()


def _through(plane: Array, points: Array) -> tuple[Array, Array]:
    """Return points (K, 2) of a plane in the plane at distance 1 (K, 2), and the derivative (K, 2, 8) by the numbers of `plane` (8,)."""
    x, y = points.T
    below = plane[6] * x + plane[7] * y + 1.0
    flat = np.stack([(plane[0] * x + plane[1] * y + plane[2]) / below, (plane[3] * x + plane[4] * y + plane[5]) / below], axis=1)
    by = np.zeros((len(points), 2, 8))
    for row in range(2):
        by[:, row, 3 * row : 3 * row + 3] = np.column_stack([x, y, np.ones(len(x))]) / below[:, None]
        by[:, row, 6:] = -flat[:, row, None] * points / below[:, None]
    return flat, by


def _pixels(lens: Lens, plane: Array, points: Array) -> Array:
    return lens.distort(_through(plane, points)[0]) * (lens.fx, lens.fy) + (lens.cx, lens.cy)


def _plane_through(corners: Array) -> Array:
    """Return the eight numbers of the perspective that takes the square [-1, 1] x [-1, 1] to corners (4, 2)."""
    rows, values = [], []
    for (x, y), (u, v) in zip(_SQUARE, corners, strict=True):
        rows += [[x, y, 1, 0, 0, 0, -u * x, -u * y], [0, 0, 0, x, y, 1, -v * x, -v * y]]
        values += [u, v]
    found: Array = np.linalg.solve(np.array(rows), np.array(values))
    return found
