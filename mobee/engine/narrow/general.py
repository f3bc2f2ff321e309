"""Every pair with a cylinder or a convex hull."""

from __future__ import annotations

import math

import numpy as np

from mobee.engine import layout
from mobee.engine.compiled import inner
from mobee.engine.narrow.slots import centers_apart
from mobee.robot.robot import Array

_BOUND = np.uint64(layout.BOUND)


@inner
def general(P: Array, a: int, b: int, V: Array, out: Array) -> float:
    """See `overlap`; so far their enclosing spheres only, which never overlap."""
    i, j = np.uint64(a), np.uint64(b)
    x, y, z = centers_apart(P, i, j)
    return min(P[i + _BOUND] + P[j + _BOUND] - math.sqrt(x * x + y * y + z * z), 0.0)
