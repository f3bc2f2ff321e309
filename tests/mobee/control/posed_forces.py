# SPDX-License-Identifier: Apache-2.0
"""Constraint forces at a pose with an arbitrary projection of the contacts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.control import Forces, Gains, constraint_forces
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class PoseWithProjection:
    """The attributes of a `Pose` that determine the forces."""

    robot: Robot
    q: Array  # (n,) rad
    projection: Array  # (n,) m^2/rad, over the whole tree

    @property
    def projection_of_part(self) -> Array:
        return self.projection


def forces_at(robot: Robot, gains: Gains, q: Array, projection: Array | None = None) -> Forces:
    """Return the forces by the compiled law; without contacts if no projection is given."""
    return constraint_forces(PoseWithProjection(robot, q, np.zeros(len(q)) if projection is None else projection), gains)
