# SPDX-License-Identifier: Apache-2.0
"""The reaches of a space, one from each state: the marker's position and Jacobian at the pose in which the reach begins.

A reach is an action that pulls a marker from the pose of a state to a target; it is the last action of a plan.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.space import Space
from mobee.model.model import Model

SCALE = 0.01  # m, unit of distances in the published equations; the thesis leaves it open


@dataclass(frozen=True, slots=True, eq=False)
class Reaches:
    """The reaches of a space, one for each state; a reach is an action that pulls a marker from the pose of the state to a target.

    `samples`: (S, d) rad, poses of the joints at which the reaches begin. `hands`: (S, 3) m, root frame, position of the marker in each of
    them. `scale`: unit of distances in thesis eqs. 8.1, 8.4, 8.5 and 8.7, m. `jacobians`: (S, 3, d) m/rad, derivative of the marker's
    position with respect to the joints; None: unknown.
    """

    samples: Array
    hands: Array
    scale: float = SCALE
    jacobians: Array | None = None

    def __post_init__(self) -> None:
        """Check shapes and values; raises InvalidValue."""
        if self.samples.ndim != 2 or self.hands.shape != (len(self.samples), 3):
            raise InvalidValue(
                f"samples of shape {self.samples.shape}, hands of {self.hands.shape}: give (S, d) rad and (S, 3) m, one row per state."
            )
        shape = len(self.samples), 3, self.samples.shape[1]
        if self.jacobians is not None and not (self.jacobians.shape == shape and np.isfinite(self.jacobians).all()):
            raise InvalidValue(f"jacobians of shape {self.jacobians.shape}: give finite m/rad, one (3, d) a state, in all {shape}.")
        if not (np.isfinite(self.samples).all() and np.isfinite(self.hands).all() and 0.0 < self.scale < np.inf):
            raise InvalidValue(f"samples, hands and scale={self.scale!r}: all must be finite, and the scale a length above 0 m.")

    def __len__(self) -> int:
        return len(self.samples)


def reaches_of(space: Space, marker: str, scale: float = SCALE) -> Reaches:
    """Compute the marker's position and Jacobian in each state of a space, with all other parts at home.

    A state stands for a pose of its joints; the other motors of the part are at `space.rest`. `scale`: unit of distances in thesis eqs.
    8.1, 8.4, 8.5 and 8.7, m. Raises UnknownName if the robot has no such marker, InvalidValue if the joints of the space do not move it.
    """
    robot = space.robot
    part = robot.part(space.part)
    jacobians = Model(robot).jacobian(_poses(space), marker)[:, :3, part.start + space.columns]
    return Reaches(space.samples, hands_of(space, marker), scale, jacobians)


def hands_of(space: Space, marker: str) -> Array:
    """Compute the marker's position in the sample of each state, shape (S, 3), in [m] in the root frame.

    The sample is the pose that stands for the state. The other motors of the part are at `space.rest`, and all other parts are at home.
    Raises UnknownName if the robot has no such marker, InvalidValue if the marker has the same position in all states.
    """
    robot = space.robot
    robot.marker(marker)
    hands = Model(robot).evaluate(_poses(space)).position(marker)
    if np.ptp(hands, axis=0).max() == 0.0:
        raise InvalidValue(f"the marker {marker!r} is moved by none of {', '.join(space.joints)}: take one that {space.part} carries.")
    return hands


def _poses(space: Space) -> Array:
    """Return the positions of all motors of the robot in each state, (S, n) rad."""
    robot = space.robot
    q = np.tile(robot.home, (len(space), 1))
    q[:, robot.part(space.part).slice] = [space.target(state) for state in range(len(space))]
    return q
