# SPDX-License-Identifier: Apache-2.0
"""Detects cameras that fail: pictures that arrive too late, are dark, or are always the same."""

from __future__ import annotations

import hashlib
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.rendering.scene import Picture

Trouble = Literal["late", "old", "dark", "frozen"]

DARK = 24.0  # of 255: a picture whose brightest pixels, but for one in a hundred, are darker shows nothing
SAME = 3  # pictures that are equal to the last bit, after which a camera with noise counts as frozen
TURN = 0.02  # rad by which a motor moves while equal pictures come: no camera shows the same then


class PictureWatch:
    """Checks the pictures of one camera for signs that they do not show the present scene.

    `latest`: largest age of a picture at its arrival, s.
    """

    def __init__(self, latest: float) -> None:
        self._latest = latest
        self._stamp = -np.inf
        self._digest, self._same = b"", 0
        self._q: Array | None = None  # at the first of the equal pictures

    def trouble(self, picture: Picture, stamp: float, now: float, q: Array, has_noise: bool) -> Trouble | None:
        """Return what is wrong with a picture, or None if nothing is wrong.

        "old": the stamp is not newer than the last one. "late": at its arrival the picture is older than the limit `latest` of this watch.
        "dark": almost nothing is bright. "frozen": the same picture has come three times in succession from a camera with noise, or came
        again after a motor had moved by more than 0.02 rad.

        Args:
            picture: (height, width, 3) bytes.
            stamp: time of its exposure, s.
            now: time of its arrival by the same clock, s.
            q: encoders at the stamp (n,) rad.
            has_noise: whether the camera is a real one, or is drawn with noise, so that no two pictures are equal.
        """
        is_new, self._stamp = stamp > self._stamp, max(stamp, self._stamp)
        digest = hashlib.blake2b(picture.tobytes(), digest_size=16).digest()
        if digest == self._digest and self._q is not None:
            self._same += 1
            moved = float(np.abs(q - self._q).max(initial=0.0))
        else:
            self._digest, self._same, self._q, moved = digest, 1, q, 0.0
        if not is_new:
            return "old"
        if now - stamp > self._latest:
            return "late"
        if float(np.quantile(picture[::4, ::4].max(axis=2), 0.99)) < DARK:
            return "dark"
        return "frozen" if (has_noise and self._same >= SAME) or moved > TURN else None
