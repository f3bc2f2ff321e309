# SPDX-License-Identifier: Apache-2.0
"""Pictures and their masks: a check of pictures that are given, and the connected regions of a mask."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from mobee.errors import InvalidValue

Mask = NDArray[np.bool_]
Labels = NDArray[np.intp]


def checked_picture(given: Any) -> NDArray[np.uint8]:
    """Return the given picture unchanged; raises InvalidValue unless it is an array (height, width, 3) of bytes with at least one pixel."""
    if not (isinstance(given, np.ndarray) and given.dtype == np.uint8 and given.ndim == 3 and given.shape[2] == 3 and given.size):
        what = f"an array {given.shape} of {given.dtype}" if isinstance(given, np.ndarray) else f"of type {type(given).__name__}"
        raise InvalidValue(f"the picture is {what}; it must be an array (height, width, 3) of uint8: red, green and blue, each 0 to 255.")
    return given


def label(mask: Mask, diagonal: bool) -> Labels:
    """Return for each pixel the label of the connected region to which it belongs, (height, width); 0 outside of the mask.

    The labels are 1, 2, ..., in the order of the first pixels of the regions. `diagonal`: whether pixels that share only a corner are
    connected too.
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
    """Return the number of the connected region of each run (sequence of pixels of the mask in one row), from 0.

    `starts`, `ends`: for each run the index of its first pixel and of the pixel after its last, in the mask row by row. `below`: pixels in
    a row. `gap`: 1 if pixels that share only a corner are connected, else 0.
    """
    first = np.searchsorted(ends - below, starts - gap, side="right")  # the first run in the next row that is connected with each run
    count = np.searchsorted(starts - below, ends + gap, side="left") - first
    upper = np.repeat(np.arange(len(starts)), count)
    lower = np.arange(len(upper)) - np.repeat(np.cumsum(count) - count, count) + first[upper]
    region = np.arange(len(starts))
    while True:  # the smallest number spreads through each region
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
    """Return the smallest box of each region, as (slice of rows, slice of columns), in the order of the regions' numbers.

    `labels`: (height, width), the numbers of the regions, as `label` returns them.
    """
    rows, columns = np.nonzero(labels)
    of = labels[rows, columns] - 1
    count = int(of.max(initial=-1)) + 1
    low, high = np.full((count, 2), max(labels.shape)), np.zeros((count, 2), dtype=np.intp)
    for axis, at in enumerate((rows, columns)):
        np.minimum.at(low[:, axis], of, at)
        np.maximum.at(high[:, axis], of, at + 1)
    return [(slice(*row), slice(*column)) for row, column in zip(*np.stack([low, high], axis=2).transpose(1, 0, 2).tolist(), strict=True)]


def without_holes(mask: Mask) -> Mask:
    """Return the mask with its holes filled.

    A hole is a set of pixels outside of the mask from which no path of pixels outside of the mask leads to the picture's border; two pixels
    of a path share a side.
    """
    outside = label(~np.pad(mask, 1), diagonal=False)
    filled: Mask = (outside != 1)[1:-1, 1:-1]
    return filled


def border(mask: Mask) -> Mask:
    """Return those pixels of a mask that share a side with a pixel outside of it, as a mask."""
    wide = np.pad(mask, 1)
    return mask & ~(wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:])
