# SPDX-License-Identifier: Apache-2.0
"""Makes detectors from a name in `DETECTORS`, from `module:name` (a function of the user), or from the file of a trained network.

The detector of a network finds the share of each pixel that a thing covers, and sharpens the edges by the colours inside and outside.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import binary_dilation, binary_erosion, uniform_filter

from mobee.rendering.camera import Floats
from mobee.rendering.scene import Picture
from mobee.settings import named, require_name
from mobee.vision.objects.detection import AREA, Detection, Detector, DetectorOf, by_color, outlined
from mobee.vision.objects.learned.network import SUFFIX, Network, load_network
from mobee.vision.objects.thing import Thing
from mobee.vision.regions import Mask, boxes, label

DETECTORS: dict[str, DetectorOf] = {"color": by_color}
FAINT = 0.1  # share below which a pixel counts as without the thing
BAND = 2  # px on each side of the edge of a region, within which pixels may be mixed
AROUND = 9  # px: side of the square in which the colours inside and outside are averaged
FEWEST = 3  # pixels of which a colour is the mean
CONTRAST = 25.0  # of 255: distance of the two colours below which the share of the network is kept
SQUARE = np.ones((3, 3), np.bool_)


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


def by_network(network: Network, things: Sequence[Thing]) -> Detector:
    """Return a detector that finds the given things with a network; the network must have been trained for these things."""
    shares = network.shares()
    names = [one.name for one in network.things]
    numbers = [names.index(one.name) for one in things]

    def detect(picture: Picture) -> list[Detection]:
        found = shares(picture)
        found[found < FAINT] = 0.0
        return [one for number in numbers for one in outlined(names[number], sharpened(picture, found[number]))]

    return detect


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
    """Return the share (h, w) of each pixel that a region covers, 0 to 1, and where this is known (h, w), for pixels near its edge.

    `colors`: (h, w, 3), a window of a picture. `own`: (h, w), pixels of the region. `anything`: pixels of all regions, this one included.
    The colour of a pixel at the edge is a mixture of the mean colours inside and outside. The share is known where both means and a
    sufficient contrast between them exist.
    """
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
