# SPDX-License-Identifier: Apache-2.0
"""Predicts the distance that remains after a reach with a linear arm: springs at the joints, and a force at the hand.

In a state with the Jacobian J, a force proportional to the remaining error e turns the joints by g J^T e, against their springs. So for the
vector w from hand to target, e = (I + g J J^T)^-1 w. The compliance g is one number for all states, fitted to the rewards.
"""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.predictors.observed import Reached
from mobee.learning.reaching.reaches import Reaches

COMPLIANCES = (0.0, 1.25, 2.5, 5.0, 10.0, 20.0, 40.0, 80.0, 160.0)  # rad/m^2, candidates of the fit
DEFAULT_COMPLIANCE = 20.0  # rad/m^2, before the first fit
PRIOR_WEIGHT = 1.0  # of slope 1 in the fit of the linear function, in reaches


class LinearArm:
    """Predicts the reward of a reach from the distance that remains with a linear arm with springs.

    The expected reward is offset + slope / (1 + distance / scale), where `scale` is that of the reaches (thesis eq. 8.4).

    Args:
        reaches: the reach actions: the marker's position and Jacobian in each state. Without Jacobians the arm does not move, and the whole
            distance remains.
        compliance: g of the springs, in rad/m^2: in a state with the Jacobian J, a remaining error e [m] turns the joints by g J^T e.
        offset, slope: of the expected reward, see above.
    """

    def __init__(self, reaches: Reaches, compliance: float = DEFAULT_COMPLIANCE, offset: float = 0.0, slope: float = 1.0) -> None:
        self.reaches, self.compliance, self.offset, self.slope = reaches, compliance, offset, slope
        joints = np.zeros((len(reaches), 3, 1)) if reaches.jacobians is None else reaches.jacobians
        squares: Array = joints @ np.swapaxes(joints, 1, 2)
        self._shares: Array = np.asarray(np.linalg.inv(np.eye(3) + compliance * squares), dtype=np.float64)

    def remaining(self, state: Ints, vector: Array) -> Array:
        """Return the distances [m] that remain after reaches from states (n,), shape (n,). `vector`: (n, 3) m, from hand to target."""
        remaining = np.einsum("nij,nj->ni", self._shares[state], vector)
        length: Array = np.sqrt((remaining**2).sum(axis=1))
        return length

    def rewards(self, state: Ints, target: Array) -> Array:
        """Return the expected rewards of reaches from states (n,) for targets (n, 3) m, or for one target (3,) m, shape (n,)."""
        expected: Array = self.offset + self.slope * self._own(state, target)
        return expected

    def fitted(self, known: Reached) -> LinearArm:
        """Return a new arm with the compliance, offset and slope that fit the observed rewards best (least squares).

        `known`: the reaches observed so far; the arm is fitted to the average reward of each pair of state and target. The compliance is
        one of COMPLIANCES; the slope has a weak prior of 1, and is at least 0.
        """
        target = known.places[known.target]
        return min((self._with(compliance, known, target) for compliance in COMPLIANCES), key=lambda found: found[0])[1]

    def _with(self, compliance: float, known: Reached, target: Array) -> tuple[float, LinearArm]:
        arm = LinearArm(self.reaches, compliance)
        own = arm._own(known.state, target)
        middle, mean = float(own.mean()), float(known.mean.mean())
        gap, error = own - middle, known.mean - mean
        arm.slope = max(
            float(gap @ error + PRIOR_WEIGHT * own @ own / len(own)) / float(gap @ gap + PRIOR_WEIGHT * own @ own / len(own)), 0.0
        )
        arm.offset = mean - arm.slope * middle
        return float(((known.mean - arm.offset - arm.slope * own) ** 2).sum()), arm

    def _own(self, state: Ints, target: Array) -> Array:
        """Return the rewards of the arm, before the linear function (thesis eq. 8.4)."""
        rewards: Array = 1.0 / (1.0 + self.remaining(state, target - self.reaches.hands[state]) / self.reaches.scale)
        return rewards
