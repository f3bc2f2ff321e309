"""The forces that constrain the dynamical system: what the model tells the controller every tick."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

from mobee.control.gains import Gains
from mobee.control.law import Law
from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Array, Robot

if TYPE_CHECKING:
    from mobee.model import Pose

# "tree": a contact is felt down to the base, so that a hand on the table also stops the torso; "part": by the part's own motors.
Propagate = Literal["tree", "part"]


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
    return forces_of(_law(pose.robot, gains, contact_forces), pose, propagate)


def forces_of(law: Law, pose: Pose, propagate: Propagate) -> Forces:
    """The constraint forces at one pose, of a law with its numbers."""
    if pose.q.ndim != 1:
        raise InvalidValue(f"a batch of poses, of shape {pose.q.shape}: forces belong to one pose")
    if propagate not in ("tree", "part"):
        raise UnknownName("propagation", propagate, ("tree", "part"))
    torque = pose.projection if propagate == "tree" else pose.projection_of_part
    return Forces(*law.forces(pose.q, torque))


@lru_cache(maxsize=8)
def _law(robot: Robot, gains: Gains, contact_forces: bool) -> Law:
    return Law(robot, gains, contact_forces=contact_forces)
