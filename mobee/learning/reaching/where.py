"""Computes the marker's position and Jacobian in each state of a space."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors.predictor import SCALE, Reaches
from mobee.learning.space import Space
from mobee.model.model import Model


def reaches_of(space: Space, marker: str, scale: float = SCALE) -> Reaches:
    """The reaches from each state by the robot's kinematics, all other parts at home; `scale` m: see `Reaches`.

    Raises UnknownName if the robot has no such marker, InvalidValue if the joints of the space do not move it.
    """
    robot = space.robot
    part = robot.part(space.part)
    jacobians = Model(robot).jacobian(_poses(space), marker)[:, :3, part.start + space.columns]
    return Reaches(space.samples, hands_of(space, marker), scale, jacobians)


def hands_of(space: Space, marker: str) -> Array:
    """Where the marker is at the sample of each state, all other parts at home: shape (S, 3), in [m] in the root frame.

    Raises UnknownName if the robot has no such marker, InvalidValue if the joints of the space do not move it.
    """
    robot = space.robot
    robot.marker(marker)
    hands = Model(robot).evaluate(_poses(space)).position(marker)
    if np.ptp(hands, axis=0).max() == 0.0:
        raise InvalidValue(f"the marker {marker!r} is moved by none of {', '.join(space.joints)}: take one that {space.part} carries.")
    return hands


def _poses(space: Space) -> Array:
    """All motors in each state, (S, n) rad."""
    robot = space.robot
    q = np.tile(robot.home, (len(space), 1))
    q[:, robot.part(space.part).slice] = [space.target(state) for state in range(len(space))]
    return q
