# SPDX-License-Identifier: Apache-2.0
"""The constraint forces at a pose whose contacts are whatever a test wants."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.control import Forces, Gains, constraint_forces
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Felt:
    """What of a `Pose` the forces are made of."""

    robot: Robot
    q: Array  # (n,) rad
    projection: Array  # (n,) m^2/rad, over the whole tree

    @property
    def projection_of_part(self) -> Array:
        return self.projection


def forces_at(robot: Robot, gains: Gains, q: Array, projection: Array | None = None) -> Forces:
    """Of the compiled law; without contacts if no projection is given."""
    return constraint_forces(Felt(robot, q, np.zeros(len(q)) if projection is None else projection), gains)
