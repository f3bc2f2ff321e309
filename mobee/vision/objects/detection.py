# SPDX-License-Identifier: Apache-2.0
"""What a detector finds in one picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mobee.arrays import Array
from mobee.rendering.scene import Picture
from mobee.vision.objects.thing import Thing


@dataclass(frozen=True, slots=True, eq=False)
class Detection:
    """What looks like a thing in one picture.

    `name`: of the thing.  `outline` (m, 2): points on its outline, px, column and row, without those at the picture's border.  `area`: px.
    `confidence`: 0 to 1.
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
"""A function of a picture (height, width, 3), bytes red, green, blue, that returns what looks like one of the things in it."""

DetectorOf = Callable[[Sequence[Thing]], Detector]
"""A function that returns the detector of some things."""
