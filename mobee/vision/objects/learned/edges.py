# SPDX-License-Identifier: Apache-2.0
"""Edges of regions to a fraction of a pixel, from the colours inside and outside of the region."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, uniform_filter

from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture
from mobee.vision.objects.outlining import AREA
from mobee.vision.regions import Mask, boxes, label

BAND = 2  # px on each side of the edge of a region, within which pixels may be mixed
AROUND = 9  # px: side of the square in which the colours inside and outside are averaged
FEWEST = 3  # pixels of which a colour is the mean
CONTRAST = 25.0  # of 255: distance of the two colours below which the share of the network is kept
SQUARE = np.ones((3, 3), np.bool_)


def sharpened(picture: Picture, shares: Floats) -> Floats:
    """Return for each pixel the share of its area that a thing covers, (H, W), 0 to 1, with sharper edges than a network's `shares`.

    The network's shares are smooth at an edge. There, the colour of a pixel is a mixture of the colours inside and outside of the thing. So
    the fraction of the inside colour in this mixture is returned as the share. `picture`: (H, W, 3), bytes red, green, blue. `shares`:
    (H, W), 0 to 1, computed by the network.
    """
    labels = label(shares >= 0.5, diagonal=True)
    found = shares.copy()
    for number, (rows, columns) in enumerate(boxes(labels), start=1):
        reach = BAND + AROUND // 2
        window = np.s_[max(0, rows.start - reach) : rows.stop + reach, max(0, columns.start - reach) : columns.stop + reach]
        own = labels[window] == number
        if own.sum() < 0.5 * AREA:
            continue
        share, is_mixed = _mixed(picture[window].astype(np.float32), own, labels[window] > 0)
        patch = found[window]
        patch[own] = 1.0
        patch[is_mixed] = share[is_mixed]
    return found


def _mixed(colors: Floats, own: Mask, anything: Mask) -> tuple[Floats, Mask]:
    """Return the share (h, w) of a region in each pixel of a window with colours (h, w, 3), and where it is known."""
    whole, beyond = binary_erosion(own, SQUARE, border_value=1), ~binary_dilation(own, SQUARE, BAND)
    inside, enough_inside = _mean(colors, whole)
    outside, enough_outside = _mean(colors, beyond & ~anything)
    line = inside - outside
    length = (line**2).sum(axis=2)
    band = ~beyond & ~binary_erosion(own, SQUARE, BAND, border_value=1) & (own | ~anything)
    share = ((colors - outside) * line).sum(axis=2) / np.maximum(length, 1.0)
    return np.clip(share, 0.0, 1.0), band & enough_inside & enough_outside & (length > CONTRAST**2)


def _mean(colors: Floats, mask: Mask) -> tuple[Floats, Mask]:
    """Return the mean colour of the pixels of a mask around each pixel, and whether there are enough of them."""
    weight = uniform_filter(mask.astype(np.float32), AROUND, mode="constant")
    mean: Floats = uniform_filter(colors * mask[..., None], (AROUND, AROUND, 1), mode="constant") / np.maximum(weight, 1e-3)[..., None]
    return mean, weight * AROUND**2 > FEWEST - 0.5
