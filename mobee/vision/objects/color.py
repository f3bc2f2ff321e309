# SPDX-License-Identifier: Apache-2.0
"""Detects things by their colour: regions of the thing's hue, and their outlines to a fraction of a pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee._core.regions import regions
from mobee.rendering.scene import Picture
from mobee.rendering.solid import Color
from mobee.vision.objects.detection import Detection, Detector
from mobee.vision.objects.thing import Thing

HUE = float(np.tan(np.deg2rad(20.0)))  # of the largest angle from the thing's hue
PALE = 0.35  # share of the thing's saturation below which a pixel is not of its colour
LEAST = 30  # of 255: brightness of colour below which there is only noise
AREA = 40.0  # px: smaller regions are ignored
AROUND = 5  # px: side of the square in which the colour of a whole pixel is looked up
FEWEST = 16  # points of an outline
MOST = 100  # points of an outline that are kept
SOLID = 0.6  # share of its convex hull that a region must fill: the things are convex


def by_color(things: Sequence[Thing]) -> Detector:
    """Return the detector that finds regions of the colours of things."""

    def detect(picture: Picture) -> list[Detection]:
        channels = np.ascontiguousarray(picture.reshape(-1, 3).T)
        spread = channels.max(axis=0) - channels.min(axis=0)
        colored = np.flatnonzero(spread >= LEAST)
        pixels = channels[:, colored].astype(np.float32)
        found = []
        for thing in things:
            likeness = np.zeros(picture.shape[:2], np.float32)
            likeness.flat[colored] = _likeness(pixels, thing.color)
            found += _regions(thing.name, likeness)
        return found

    return detect


def _likeness(pixels: NDArray[np.float32], color: Color) -> NDArray[np.float32]:
    """Return how much of a colour is in each of some pixels (3, m): linear in the share of the pixel that has the colour; else 0."""
    wanted = np.array(color, np.float32)
    chroma = wanted - wanted.mean()
    strength = float(np.linalg.norm(chroma))
    chroma /= strength
    along: NDArray[np.float32] = chroma @ pixels
    along[along < np.maximum(LEAST, PALE * strength / float(wanted.max()) * pixels.max(axis=0))] = 0.0
    some = np.flatnonzero(along)
    chosen = pixels[:, some]
    across = ((chosen - chosen.mean(axis=0)) ** 2).sum(axis=0) - along[some] ** 2
    along[some[across > (HUE * along[some]) ** 2]] = 0.0
    return along


def _regions(name: str, likeness: NDArray[np.float32]) -> list[Detection]:
    """Return the regions with a likeness, as detections."""
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
