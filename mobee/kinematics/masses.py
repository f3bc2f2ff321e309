"""A robot's masses, and where their centre is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.kinematics.forward import link_transforms
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Ints, Robot


@dataclass(frozen=True, slots=True, eq=False)
class Masses:
    """The links of a robot that have a mass."""

    links: Ints  # (B,)
    weights: Array  # (B,) kg
    moments: Array  # (B, 4, 1) kg times (centre, 1), root frame, zero pose

    def moved(self, transforms: Array) -> Array:
        """Mass times centre (..., B, 3) kg m, root frame, from all links' transforms (..., L, 4, 4)."""
        moments: Array = (transforms[..., self.links, :3, :] @ self.moments)[..., 0]
        return moments


@per_robot
def masses(robot: Robot) -> Masses:
    """Those of a robot; B is 0 where its file says nothing of masses."""
    links = np.array([body.link for body in robot.bodies], dtype=np.intp)
    weights = np.array([body.mass for body in robot.bodies])
    centres = np.array([[*body.centre, 1.0] for body in robot.bodies]).reshape(len(links), 4)
    return Masses(links, weights, (weights[:, None] * centres)[..., None])


def centre_of_mass(robot: Robot, transforms: Array) -> Array:
    """The centre of mass (..., 3) m, root frame, from all links' transforms (..., L, 4, 4); raises InvalidValue if no link has a mass."""
    if not robot.bodies:
        raise InvalidValue(f"{robot.name!r} has no masses (<mass> in its file), so nothing says where its centre of mass is.")
    known = masses(robot)
    centre: Array = known.moved(transforms).sum(axis=-2) / known.weights.sum()
    return centre


@per_robot
def centre_of_mass_at_home(robot: Robot) -> Array:
    """The same (3,) m in the robot's home posture."""
    return centre_of_mass(robot, link_transforms(robot, robot.home))
