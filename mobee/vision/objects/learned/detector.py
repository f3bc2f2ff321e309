# SPDX-License-Identifier: Apache-2.0
"""Detects things (objects of known shape, size and colour) by a network that was trained on rendered pictures of them."""

from __future__ import annotations

from collections.abc import Sequence

from mobee.rendering.scene import Picture
from mobee.vision.objects.detection import Detection, Detector
from mobee.vision.objects.learned.edges import sharpened
from mobee.vision.objects.learned.network import Network
from mobee.vision.objects.outlining import outlined
from mobee.vision.objects.thing import Thing

FAINT = 0.1  # share below which a pixel counts as without the thing


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
