# SPDX-License-Identifier: Apache-2.0
"""Detections: the regions of one picture that may show a thing, an object of known shape, size and colour."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mobee.arrays import Array
from mobee.rendering.scene import Picture
from mobee.vision.objects.thing import Thing


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
