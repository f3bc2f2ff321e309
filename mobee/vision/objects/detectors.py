# SPDX-License-Identifier: Apache-2.0
"""The detectors that have a name; others are chosen as `module:name`."""

from __future__ import annotations

from collections.abc import Sequence

from mobee.settings import named
from mobee.vision.objects.color import by_color
from mobee.vision.objects.detection import Detector, DetectorOf
from mobee.vision.objects.thing import Thing

DETECTORS: dict[str, DetectorOf] = {"color": by_color}


def detector_of(given: str | DetectorOf, things: Sequence[Thing]) -> Detector:
    """Return the detector of some things: by a name in the table, `module:name`, or a function; raises UnknownName and InvalidValue."""
    return named("detector", given, DETECTORS)[1](things)
