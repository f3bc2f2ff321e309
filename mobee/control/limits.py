"""The force that keeps a motor inside its limits (thesis eqs. 5.12-5.13)."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array


def limit_forces(q: Array, limits: Array, width: float, maximum: float) -> Array:
    """Zero inside [min + width, max - width], a linear ramp inward to `maximum` at the limit and on beyond it.

    `q` (..., n) and `limits` (n, 2) rad; `width` rad; `maximum` and the result (..., n) in rad/s^2.  The thesis prints
    the ranges of eq. 5.12 wrong: continuity and the direction (inward) decide.  Where a motor's range is
    narrower than two widths the two ramps add up, to zero in the middle.
    """
    below = np.maximum(limits[:, 0] + width - q, 0.0)
    above = np.maximum(q - limits[:, 1] + width, 0.0)
    return maximum / width * (below - above)
