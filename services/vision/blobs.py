"""Red regions of a picture: which pixels are red, and the border of each connected region."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Mask = NDArray[np.bool_]
Pixels = NDArray[np.int64]

HUE_SPREAD, MIN_SATURATION, MIN_VALUE = 8, 130, 50  # hue in units of 2 deg, 0..180, the rest 0..255


def red_pixels(picture: Picture) -> Mask:
    """Which pixels of a picture (height, width, 3) of bytes red, green, blue are red, by OpenCV's hue and saturation (height, width)."""
    red, green, blue = np.ascontiguousarray(picture.transpose(2, 0, 1))
    mask = (red >= MIN_VALUE) & (np.minimum(green, blue) <= red >> 1) & (red >= np.maximum(green, blue))  # most pixels fail here
    value, green, blue = (channel[mask].astype(np.int32) for channel in (red, green, blue))
    spread = value - np.minimum(green, blue)
    saturation = (spread * _per(255, 1.0)[value] + 2048) >> 12
    hue = ((green - blue) * _per(180, 6.0)[spread] + 2048) >> 12
    mask[mask] = (saturation >= MIN_SATURATION) & (np.abs(hue) <= HUE_SPREAD)
    return mask


def outer_borders(mask: Mask, min_pixels: int) -> list[Pixels]:
    """The outer border (m, 2) of each region of at least so many pixels, as columns and rows, once around; the topmost region first.

    Pixels that touch at a corner are of one region.  A pixel that the way around passes twice stands there twice.
    """
    framed = np.pad(mask, 1)
    inside, width = framed.tobytes(), framed.shape[1]
    borders = [np.array(_border(inside, width, first)) for first, count in _regions(framed) if count >= min_pixels]
    return [np.column_stack([border % width, border // width]) - 1 for border in borders]


def enclosed_area(border: Pixels) -> float:
    """The area of the polygon through a border's pixels, in pixels."""
    x, y = border.T
    return 0.5 * abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1)))


@cache
def _per(scale: int, parts: float) -> NDArray[np.int32]:
    """Factors that divide by a byte: 4096 scale / (parts byte), rounded."""
    factors = np.rint((scale << 12) / (parts * np.maximum(np.arange(256), 1)))
    factors[0] = 0.0
    return factors.astype(np.int32)


def _regions(framed: Mask) -> list[tuple[int, int]]:
    """Of each region: the leftmost pixel of its topmost row, counted along the rows, and its number of pixels."""
    flat, width = framed.ravel(), framed.shape[1]
    edges = np.flatnonzero(flat[1:] != flat[:-1]) + 1  # the frame ends each run in its row
    starts, ends = edges[::2].tolist(), edges[1::2].tolist()  # ends: one behind the last pixel
    parent = list(range(len(starts)))

    def root(run: int) -> int:
        while parent[run] != run:
            parent[run] = run = parent[parent[run]]
        return run

    above = 0  # the first run that may touch the one at hand
    for run, (start, end) in enumerate(zip(starts, ends, strict=True)):
        while ends[above] < start - width:
            above += 1
        other = above
        while starts[other] <= end - width:
            first, second = sorted((root(other), root(run)))
            parent[second] = first
            other += 1
    count = [0] * len(starts)
    for run, (start, end) in enumerate(zip(starts, ends, strict=True)):
        count[root(run)] += end - start
    return [(starts[run], count[run]) for run in range(len(starts)) if parent[run] == run]


def _border(inside: bytes, width: int, first: int) -> list[int]:
    """Once around a region, from the leftmost pixel of its topmost row, along its outside (Suzuki and Abe 1985)."""
    around = (1, width + 1, width, width - 1, -1, -width - 1, -width, 1 - width)  # the eight neighbours, clockwise from the right
    # The pixel to the left is outside: look from there clockwise for the last pixel of the way around.
    towards = next((turn % 8 for turn in range(4, 12) if inside[first + around[turn % 8]]), None)
    if towards is None:
        return [first]
    last, here, found = first + around[towards], first, []
    while True:
        found.append(here)
        # Counter-clockwise from where we came, to the next pixel of the region.
        turn = towards - 1
        while not inside[here + around[turn % 8]]:
            turn -= 1
        there = here + around[turn % 8]
        if there == first and here == last:
            return found
        here, towards = there, (turn + 4) % 8
