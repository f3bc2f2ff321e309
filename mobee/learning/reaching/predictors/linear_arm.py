"""Predicts the remaining error of a reach from a linear arm: springs at the joints, a force at the hand.

In the pose of a state with the Jacobian J, a pull of the remaining way e turns the joints by g J^T e, against their springs.  So of the
way w, e = (I + g J J^T)^-1 w is left.  How far the joints give, g, is one number for all states, fitted to the rewards seen.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.predictors.observed import Reached
from mobee.learning.reaching.reaches import Reaches

GIVES = (0.0, 1.25, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0)  # rad/m^2
USUAL = 20.0  # before anything is known
HOLD = 1.0  # how much the line through the rewards holds to the linear arm's own, in reaches


class LinearArm:
    """An arm whose joints give so much, and a line from the rewards that it would get to those that are expected.

    Args:
        reaches: the reach actions; without Jacobians nothing is known of how the hand moves, and all of the way is left.
        give: g, in rad/m^2.
        offset, slope: of the line.
    """

    def __init__(self, reaches: Reaches, give: float = USUAL, offset: float = 0.0, slope: float = 1.0) -> None:
        self.reaches, self.give, self.offset, self.slope = reaches, give, offset, slope
        joints = np.zeros((len(reaches), 3, 1)) if reaches.jacobians is None else reaches.jacobians
        squares: Array = joints @ np.swapaxes(joints, 1, 2)
        self._shares: Array = np.asarray(np.linalg.inv(np.eye(3) + give * squares), dtype=np.float64)

    def left(self, state: Ints, way: Array) -> Array:
        """How much is left of ways (n, 3) m from states (n,), shape (n,), in m."""
        remaining = np.einsum("nij,nj->ni", self._shares[state], way)
        length: Array = np.sqrt((remaining**2).sum(axis=1))
        return length

    def rewards(self, state: Ints, target: Array) -> Array:
        """What reaching from states (n,) for targets (n, 3) m, or for one (3,) m, is expected to bring, shape (n,)."""
        expected: Array = self.offset + self.slope * self._own(state, target)
        return expected

    def fitted(self, known: Reached) -> LinearArm:
        """One that gives as much, with such a line, that the squared error of the rewards seen is least."""
        target = known.places[known.target]
        return min((self._with(give, known, target) for give in GIVES), key=lambda found: found[0])[1]

    def _with(self, give: float, known: Reached, target: Array) -> tuple[float, LinearArm]:
        arm = LinearArm(self.reaches, give)
        own = arm._own(known.state, target)
        middle, mean = float(own.mean()), float(known.mean.mean())
        gap, error = own - middle, known.mean - mean
        arm.slope = max(float(gap @ error + HOLD * own @ own / len(own)) / float(gap @ gap + HOLD * own @ own / len(own)), 0.0)
        arm.offset = mean - arm.slope * middle
        return float(((known.mean - arm.offset - arm.slope * own) ** 2).sum()), arm

    def _own(self, state: Ints, target: Array) -> Array:
        """The linear arm's own rewards (thesis eq. 8.4)."""
        rewards: Array = 1.0 / (1.0 + self.left(state, target - self.reaches.hands[state]) / self.reaches.scale)
        return rewards
