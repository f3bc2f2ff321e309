"""The forces that constrain the dynamical system: what the model tells the controller every tick."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from mobee.control.collision import Propagate, collision_forces
from mobee.control.constraints import ClauseRows, clause_forces, clause_forces_2014, stack_clauses
from mobee.control.gains import Gains
from mobee.control.limits import limit_forces
from mobee.robot.robot import Array, Robot

if TYPE_CHECKING:
    from mobee.model import Pose


@dataclass(frozen=True, slots=True, eq=False)
class Forces:
    """f_lim, f_cst and f_coll of eq. 5.7, each (n,) in rad/s^2 (force per unit mass), already bounded."""

    limits: Array
    constraints: Array
    collision: Array

    @property
    def total(self) -> Array:
        """Their sum, shape (n,), in [rad/s^2]."""
        return self.limits + self.constraints + self.collision


def constraint_forces(pose: Pose, gains: Gains, propagate: Propagate = "tree", contact_forces: bool = True) -> Forces:
    """The constraint forces at one pose (thesis eqs. 5.11-5.17).

    `propagate`: how far down the body a contact is felt.  `contact_forces` False leaves f_coll
    at zero, for the control experiment in which touching has no effect.
    """
    robot = pose.robot
    clauses = clause_forces_2014 if gains.law == "published_2014" else clause_forces
    collision = np.zeros(len(pose.q))
    if contact_forces:
        collision = collision_forces(robot, pose.projection if propagate == "tree" else pose.projection_of_part, gains)
    return Forces(
        limit_forces(pose.q, robot.limits, gains.limit_width, gains.max_limit),
        clauses(_rows(robot), pose.q, gains.constraint_width, gains.max_constraint),
        collision,
    )


@lru_cache(maxsize=8)
def _rows(robot: Robot) -> ClauseRows:
    return stack_clauses(robot.clauses, len(robot.motor_table))
