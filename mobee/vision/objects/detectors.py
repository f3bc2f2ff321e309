# SPDX-License-Identifier: Apache-2.0
"""The detectors that have a name; others are chosen as `module:name`, or by the file of a network."""

from __future__ import annotations

from collections.abc import Sequence

from mobee.settings import named, require_name
from mobee.vision.objects.color import by_color
from mobee.vision.objects.detection import Detector, DetectorOf
from mobee.vision.objects.learned.detector import by_network
from mobee.vision.objects.learned.network import SUFFIX, load_network
from mobee.vision.objects.thing import Thing

DETECTORS: dict[str, DetectorOf] = {"color": by_color}


def detector_of(given: str | DetectorOf, things: Sequence[Thing]) -> Detector:
    """Return the detector of some things.

    Args:
        given: a name in the table, `module:name`, a function, or the path of a file of `mobee detector train`, which ends in .onnx.
        things: what is to be found.

    Raises:
        UnknownName, InvalidValue: there is no such detector, or the file is damaged or of other things.
        NotInstalled: the file needs a package that is not installed.
    """
    if isinstance(given, str) and given.endswith(SUFFIX):
        network = load_network(given)
        network.require(things, given)
        return by_network(network, things)
    return named("detector", given, DETECTORS)[1](things)


def require_detector(given: str, things: Sequence[Thing]) -> None:
    """Raise what `detector_of` would raise for a name or a file; imports no module of the user."""
    if given.endswith(SUFFIX):
        detector_of(given, things)
    else:
        require_name("detector", given, {**DETECTORS, f"path of a {SUFFIX} file": None})
