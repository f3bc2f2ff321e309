# SPDX-License-Identifier: Apache-2.0
"""Detections: the regions of one picture that may show a thing, an object of known shape, size and colour.

A detector finds them; `by_color` makes one that finds the colours of the things, with outlines to a fraction of a pixel.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee._core.vision import regions
from mobee.arrays import Array
from mobee.rendering.scene import Picture
from mobee.rendering.solid import Color
from mobee.vision.objects.thing import Thing
from mobee.vision.regions import checked_picture

AREA = 40.0  # px: smaller regions are ignored
AROUND = 5  # px: side of the square in which the likeness of a whole pixel is looked up
FEWEST = 16  # points of an outline
MOST = 100  # points of an outline that are kept
SOLID = 0.6  # share of its convex hull that a region must fill: the things are convex
HUE = float(np.tan(np.deg2rad(20.0)))  # of the largest angle from the thing's hue
PALE = 0.35  # share of the thing's saturation below which a pixel is not of its colour
LEAST = 30  # of 255: brightness of colour below which there is only noise


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """A region of one picture that may show a thing, an object of known shape, size and colour (`Thing`).

    `name`: name of the thing. `outline`: (m, 2) px, column and row of points on the region's outline, without points at the picture's
    border. `area`: in pixels. `confidence`: 0 to 1.
    """

    name: str
    outline: Array
    area: float
    confidence: float

    @property
    def centre(self) -> Array:
        """The middle (2,) of the box around the outline, px."""
        middle: Array = 0.5 * (self.outline.min(axis=0) + self.outline.max(axis=0))
        return middle


Detector = Callable[[Picture], Sequence[Detection]]
"""A function that takes a picture (height, width, 3), bytes red, green, blue, and returns the detections of its things."""

DetectorOf = Callable[[Sequence[Thing]], Detector]
"""A function that takes things and returns a detector of these things."""


def outlined(name: str, likeness: NDArray[np.float32]) -> list[Detection]:
    """Return the regions of a picture that show a thing (an object of known shape, size and colour), as detections.

    `name`: name of the thing. `likeness`: (H, W), either the share of each pixel that the thing covers, 0 to 1, or larger numbers that are
    proportional to this share. The share of a pixel is then estimated: its likeness is divided by the largest likeness in the 5 x 5 pixels
    around it, but never by less than 1. Only pixels connected to it by pixels with a likeness above 0 count. A region is a connected set
    of pixels with shares of at least 0.5. Left out are regions of less than 40 pixels, regions with fewer than 16 outline points inside
    the picture's border, and regions that fill less than 60 % of their convex hull.
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


def by_color(things: Sequence[Thing]) -> Detector:
    """Return a detector that finds regions with the colours of the given things.

    Warns of each thing that is black, white or nearly grey, and does not look for it: such a colour has no hue that could be found.
    """
    for thing in things:
        if not _has_hue(thing.color):
            warnings.warn(
                f"the detector by colour cannot find {thing.name!r}: its colour {thing.color} has no hue. "
                "Give it another colour, or use a trained detector (mobee detector train)",
                stacklevel=2,
            )
    things = [thing for thing in things if _has_hue(thing.color)]

    def detect(picture: Picture) -> list[Detection]:
        channels = np.ascontiguousarray(checked_picture(picture).reshape(-1, 3).T)
        spread = channels.max(axis=0) - channels.min(axis=0)
        colored = np.flatnonzero(spread >= LEAST)
        pixels = channels[:, colored].astype(np.float32)
        found = []
        for thing in things:
            likeness = np.zeros(picture.shape[:2], np.float32)
            likeness.flat[colored] = _likeness(pixels, thing.color)
            found += outlined(thing.name, likeness)
        return found

    return detect


def _chroma(color: Color) -> NDArray[np.float32]:
    """Return the colour without its grey, (3,)."""
    wanted = np.array(color, np.float32)
    chroma: NDArray[np.float32] = wanted - wanted.mean()
    return chroma


def _has_hue(color: Color) -> bool:
    """Return whether a pixel of this colour can be brighter of it than the noise (LEAST)."""
    return float(np.linalg.norm(_chroma(color))) >= LEAST / 255.0


def _likeness(pixels: NDArray[np.float32], color: Color) -> NDArray[np.float32]:
    """Return for each pixel of `pixels` (3, m) how much of a colour it has, (m,): 0 if it is too pale or has another hue.

    Else the value is proportional to the share of the pixel that has this colour.
    """
    chroma = _chroma(color)
    strength = float(np.linalg.norm(chroma))
    chroma /= strength
    along: NDArray[np.float32] = chroma @ pixels
    along[along < np.maximum(LEAST, PALE * strength / max(color) * pixels.max(axis=0))] = 0.0
    some = np.flatnonzero(along)
    chosen = pixels[:, some]
    across = ((chosen - chosen.mean(axis=0)) ** 2).sum(axis=0) - along[some] ** 2
    along[some[across > (HUE * along[some]) ** 2]] = 0.0
    return along
