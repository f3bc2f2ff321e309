# SPDX-License-Identifier: Apache-2.0
"""Observations of the tag on a robot's palm, with the encoders at the same times."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.vision.encoders import Moment


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The tag on the robot's palm in the pictures of all cameras with the same stamp (time of the picture).

    `moment`: the encoders at the stamp. `corners`: by name of the camera, the corners (4, 2) px of the tag, column and row, in the order of
    `Tag.corners`; a camera that does not see the tag is missing.
    """

    moment: Moment
    corners: Mapping[str, Array]


def stacked(observations: Sequence[Observation]) -> tuple[Array, Array, Array]:
    """Return the encoders q (N, n) rad, their velocities dq (N, n) rad/s and the variances of q (N, n) rad^2 of N observations."""
    moments = [one.moment for one in observations]
    return np.array([one.q for one in moments]), np.array([one.dq for one in moments]), np.array([one.variance for one in moments])
