# SPDX-License-Identifier: Apache-2.0
"""Connected regions of an image mask."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Mask = NDArray[np.bool_]
Labels = NDArray[np.intp]


def label(mask: Mask, diagonal: bool) -> Labels:
    """The number of the region that each pixel belongs to, shape (height, width): from 1 in the order of their first pixels, 0 outside.

    `diagonal`: pixels that share a corner only are connected too.
    """
    height, width = mask.shape
    line = np.zeros((height, width + 1), dtype=np.int8)  # one pixel more, so that no run of pixels continues in the next row
    line[:, :width] = mask
    steps = np.diff(line.ravel(), prepend=np.int8(0))
    starts, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    region = _connected(starts, ends, width + 1, int(diagonal))
    labels = np.zeros(height * (width + 1), dtype=np.intp)
    labels[line.ravel() == 1] = np.repeat(region + 1, ends - starts)
    return labels.reshape(height, width + 1)[:, :width]


def _connected(starts: Labels, ends: Labels, below: int, gap: int) -> Labels:
    """The region of each run of pixels, from 0; `below`: from a pixel to that under it, `gap`: how far apart connected runs may be."""
    first = np.searchsorted(ends - below, starts - gap, side="right")  # of the runs in the next row that each run is connected with
    count = np.searchsorted(starts - below, ends + gap, side="left") - first
    upper = np.repeat(np.arange(len(starts)), count)
    lower = np.arange(len(upper)) - np.repeat(np.cumsum(count) - count, count) + first[upper]
    region = np.arange(len(starts))
    while True:  # the smallest number of a region spreads, and what has it takes over its own number's
        smallest = region.copy()
        np.minimum.at(smallest, lower, region[upper])
        np.minimum.at(smallest, upper, region[lower])
        smallest = smallest[smallest]
        if (smallest == region).all():
            break
        region = smallest
    is_first = region == np.arange(len(region))
    numbers: Labels = (np.cumsum(is_first) - 1)[region]
    return numbers


def boxes(labels: Labels) -> list[tuple[slice, slice]]:
    """The rows and columns that each region takes, the first region's first."""
    rows, columns = np.nonzero(labels)
    of = labels[rows, columns] - 1
    count = int(of.max(initial=-1)) + 1
    low, high = np.full((count, 2), max(labels.shape)), np.zeros((count, 2), dtype=np.intp)
    for axis, at in enumerate((rows, columns)):
        np.minimum.at(low[:, axis], of, at)
        np.maximum.at(high[:, axis], of, at + 1)
    return [(slice(*row), slice(*column)) for row, column in zip(*np.stack([low, high], axis=2).transpose(1, 0, 2).tolist(), strict=True)]


def without_holes(mask: Mask) -> Mask:
    """The mask with everything in it that no path of pixels, from side to side, connects with the outside."""
    outside = label(~np.pad(mask, 1), diagonal=False)
    filled: Mask = (outside != 1)[1:-1, 1:-1]
    return filled


def border(mask: Mask) -> Mask:
    """Its pixels with a side towards a pixel that is outside."""
    wide = np.pad(mask, 1)
    return mask & ~(wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:])
