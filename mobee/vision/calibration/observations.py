# SPDX-License-Identifier: Apache-2.0
"""What a robot saw of the tag on its palm, and what its encoders said meanwhile."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.vision.encoders import Moment


@dataclass(frozen=True, slots=True, eq=False)
class Observation:
    """The tag in pictures of one stamp: the encoders then, and its corners (4, 2) px by camera."""

    moment: Moment
    corners: Mapping[str, Array]


def stacked(observations: Sequence[Observation]) -> tuple[Array, Array, Array]:
    """Return q (N, n) rad, dq (N, n) rad/s and the variances (N, n) of all observations."""
    moments = [one.moment for one in observations]
    return np.array([one.q for one in moments]), np.array([one.dq for one in moments]), np.array([one.variance for one in moments])
