"""The targets of the thesis: 27 spheres of 10 cm on a grid that roughly covers the workspace of the right arm (thesis 8.3, fig. 8.1).

The figure gives no coordinates.  The original's program draws targets from x -0.4 to -0.1, y 0 to 0.4 and z 0 to 0.4 m in steps of 0.1,
in the root frame: x is negative in front of the robot, y positive to its right, z positive upwards.  The places here are every second
of those in y and z, and all in x but the farthest, which lies at the end of the stretched arm.  How many of them inverse kinematics
can reach is in this folder's README.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from mobee.reach import Aim, ReachTarget
from mobee.robot.robot import Array

GOOD = 0.02  # m from the surface, within which a target counts as reached, as in `mobee reach`
X, Y, Z = (-0.3, -0.2, -0.1), (0.0, 0.2, 0.4), (0.0, 0.2, 0.4)  # m


def grid() -> Array:
    """The 27 places, shape (27, 3), in [m] in the root frame; z changes fastest, x slowest."""
    return np.array(list(product(X, Y, Z)))


def between() -> Array:
    """The middles of the eight cells between them, shape (8, 3), in [m]: targets that nobody has tried."""
    return np.array(list(product(*((np.array(levels[1:]) + levels[:-1]) / 2.0 for levels in (X, Y, Z)))))


def targets_at(places: Array, aim: Aim = "centre") -> list[ReachTarget]:
    """Spheres of 10 cm at places (P, 3) m."""
    return [ReachTarget(place, aim=aim) for place in places]
