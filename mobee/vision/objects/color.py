# SPDX-License-Identifier: Apache-2.0
"""Detects things (objects of known shape, size and colour) by their colour: finds their regions, with outlines to a fraction of a pixel."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from mobee.rendering.scene import Picture
from mobee.rendering.solid import Color
from mobee.vision.objects.detection import Detection, Detector
from mobee.vision.objects.outlining import outlined
from mobee.vision.objects.thing import Thing

HUE = float(np.tan(np.deg2rad(20.0)))  # of the largest angle from the thing's hue
PALE = 0.35  # share of the thing's saturation below which a pixel is not of its colour
LEAST = 30  # of 255: brightness of colour below which there is only noise


def by_color(things: Sequence[Thing]) -> Detector:
    """Return a detector that finds regions with the colours of the given things."""

    def detect(picture: Picture) -> list[Detection]:
        channels = np.ascontiguousarray(picture.reshape(-1, 3).T)
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
