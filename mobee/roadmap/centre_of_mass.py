"""Where the centre of a robot's masses is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.kinematics.forward import link_transforms
from mobee.robot.per_robot import per_robot
from mobee.robot.robot import Array, Ints, Robot


@dataclass(frozen=True, slots=True, eq=False)
class Weighed:
    """A robot's masses, as shares of their sum."""

    links: Ints  # (B,)
    shares: Array  # (B, 4): share times (centre, 1), root frame, zero pose
    at_home: Array  # (3,) m

    def of(self, transforms: Array) -> Array:
        """The centre of mass (..., 3) m, root frame, from all links' transforms (..., L, 4, 4)."""
        return _centre(transforms, self.links, self.shares)


@per_robot
def centre_of_mass(robot: Robot) -> Weighed:
    """What tells a robot's centre of mass; raises InvalidValue if no link has a mass."""
    if not robot.bodies:
        raise InvalidValue(f"{robot.name!r} has no masses (<mass> in its file), so nothing says where its centre of mass is.")
    links = np.array([body.link for body in robot.bodies], dtype=np.intp)
    masses = np.array([body.mass for body in robot.bodies])
    shares = (masses / masses.sum())[:, None] * np.array([[*body.centre, 1.0] for body in robot.bodies])
    return Weighed(links, shares, _centre(link_transforms(robot, robot.home), links, shares))


def _centre(transforms: Array, links: Ints, shares: Array) -> Array:
    centre: Array = np.einsum("...bij,bj->...i", transforms[..., links, :3, :], shares)
    return centre
