# SPDX-License-Identifier: Apache-2.0
"""The encoders at the stamp of a picture, from the readings around it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue

WINDOW = 0.035  # s: readings within this time of the stamp are used


@dataclass(frozen=True, slots=True, eq=False)
class Moment:
    """The encoders at one time, by a line through the readings around it: q (n,) rad, dq (n,) rad/s, and the variances (n,) of q."""

    q: Array
    dq: Array
    variance: Array


def moment_at(times: Array, readings: Array, t: float, noise: Array) -> Moment:
    """Return the encoders at time t [s] from readings (m, n) rad at times (m,) s, by least squares within WINDOW of t.

    `noise`: standard deviations (n,) of one reading, rad.  Raises InvalidValue if fewer than two readings are near.
    """
    near = np.abs(times - t) <= WINDOW
    if near.sum() < 2:
        raise InvalidValue(f"{int(near.sum())} readings of the encoders within {WINDOW} s of {t:.3f} s: at least 2 are needed")
    inverse = np.linalg.pinv(np.stack([np.ones(int(near.sum())), times[near] - t], axis=1))
    line = inverse @ readings[near]
    return Moment(line[0], line[1], float(inverse[0] @ inverse[0]) * noise**2)
