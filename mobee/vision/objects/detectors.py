# SPDX-License-Identifier: Apache-2.0
"""Makes a detector from its name in `DETECTORS`, from `module:name` (a function of the user), or from the file of a trained network."""

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
    """Return a detector of the given things (kinds of objects of known shape, size and colour).

    Args:
        given: "color" (finds regions with the colours of the things); a function that takes things and returns a detector, or the text
            `module:name` of such a function; or the path of a file that `mobee detector train` wrote, which ends in .onnx.
        things: the things to be found.

    Raises:
        UnknownName, InvalidValue: there is no such detector, or the file is damaged or was made for other things.
        NotInstalled: the file needs a package that is not installed.
    """
    if isinstance(given, str) and given.endswith(SUFFIX):
        network = load_network(given)
        network.require(things, given)
        return by_network(network, things)
    return named("detector", given, DETECTORS)[1](things)


def require_detector(given: str, things: Sequence[Thing]) -> None:
    """Check `given`, the name or file of a detector, without importing a module of the user.

    Raises the errors of `detector_of`: UnknownName, InvalidValue or NotInstalled.
    """
    if given.endswith(SUFFIX):
        detector_of(given, things)
    else:
        require_name("detector", given, {**DETECTORS, f"path of a {SUFFIX} file": None})
