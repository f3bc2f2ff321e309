"""Small vector arithmetic."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array


def cross(a: Array, b: Array) -> Array:
    """Cross products over the last dimension, (..., 3); np.cross costs several times as much on a few rows."""
    out = np.empty(np.broadcast_shapes(a.shape, b.shape))
    out[..., 0] = a[..., 1] * b[..., 2] - a[..., 2] * b[..., 1]
    out[..., 1] = a[..., 2] * b[..., 0] - a[..., 0] * b[..., 2]
    out[..., 2] = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return out
