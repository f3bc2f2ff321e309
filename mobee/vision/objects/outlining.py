# SPDX-License-Identifier: Apache-2.0
"""Regions of a picture that show a thing (an object of known shape, size and colour), and their outlines, as detections."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mobee._core.regions import regions
from mobee.vision.objects.detection import Detection

AREA = 40.0  # px: smaller regions are ignored
AROUND = 5  # px: side of the square in which the likeness of a whole pixel is looked up
FEWEST = 16  # points of an outline
MOST = 100  # points of an outline that are kept
SOLID = 0.6  # share of its convex hull that a region must fill: the things are convex


def outlined(name: str, likeness: NDArray[np.float32]) -> list[Detection]:
    """Return the regions of a picture that show a thing (an object of known shape, size and colour), as detections.

    `name`: name of the thing. `likeness`: (H, W), either the share of each pixel that the thing covers, 0 to 1, or larger numbers that are
    proportional to this share. The share of a pixel is computed as its number divided by the largest number of its region in the 5 x 5
    pixels around it, or by 1 if the largest number is below 1. Left out are regions of less than 40 pixels, regions with fewer than 16
    outline points inside the picture's border, and regions that fill less than 60 % of their convex hull.
    """
    height, width = likeness.shape
    found = []
    for region in regions(likeness, AREA, AROUND):
        outline, filled = region.outline, min(1.0, region.area / max(region.hull, 1e-9))
        within = ((outline > 0.5) & (outline < (width - 1.5, height - 1.5))).all(axis=1)
        if within.sum() < FEWEST or filled < SOLID:
            continue
        every = np.linspace(0, within.sum() - 1, min(MOST, int(within.sum()))).astype(int)
        found.append(Detection(name, outline[within][every], float(region.area), filled * float(within.mean())))
    return found
