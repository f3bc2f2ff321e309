"""Where a marker is in each state of a space."""

from __future__ import annotations

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.space import Space
from mobee.model import Model
from mobee.robot.robot import Array


def hands_of(space: Space, marker: str) -> Array:
    """Where the marker is at the sample of each state, all other parts at home: shape (S, 3), in [m] in the root frame.

    Raises UnknownName if the robot has no such marker, InvalidValue if the joints of the space do not move it.
    """
    robot = space.robot
    robot.marker(marker)
    q = np.tile(robot.home, (len(space), 1))
    q[:, robot.part(space.part).slice] = [space.target(state) for state in range(len(space))]
    hands = Model(robot).evaluate(q).position(marker)
    if np.ptp(hands, axis=0).max() == 0.0:
        raise InvalidValue(f"the marker {marker!r} is moved by none of {', '.join(space.joints)}: take one that {space.part} carries.")
    return hands
