# SPDX-License-Identifier: Apache-2.0
"""Nadaraya-Watson kernel regression of rewards over poses and targets; the widths of the kernels are chosen by leave-one-out errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.learning.reaching.predictors.covariance import joint_squares
from mobee.learning.reaching.predictors.observed import Independent, Reached, around
from mobee.learning.reaching.predictors.predictor import DistancePrior
from mobee.learning.reaching.reaches import Reaches

JOINTS = (0.05, 0.15, 0.3, 0.5, 0.8)  # scales of the poses, in units of the spread of the samples
PLACES = (0.03, 0.06, 0.1, 0.15, 0.25)  # of the targets, m
PRIOR_WEIGHT = 0.2  # of the prior at every pose and target, in reaches
REFIT = 1.2  # factor of the number of reaches at which scales and prior are fitted again
MAX_LEFT_OUT = 400  # pairs that are predicted from all others


class Kernel(Independent):
    """Predicts the rewards of reaches by averages of observed rewards, with Gaussian weights over poses and targets.

    If few reaches were observed with a similar pose and target, the prediction is close to the prior mean.

    Args:
        reaches: the pose at which the reach of each state begins, and the marker's position in it.
        prior: the prior mean: True: the reward expected from the distance between hand and target; False: the average of the rewards of all
            pairs of state and target, with four imagined pairs.
    """

    def __init__(self, reaches: Reaches, prior: bool = False) -> None:
        super().__init__()
        self._reaches, self._prior = reaches, prior
        squares = joint_squares(reaches).sum(axis=0)
        self._alike = np.stack([np.exp(-0.5 * squares / scale**2) for scale in JOINTS])
        self._next = 0.0
        self._scales = JOINTS[2], PLACES[2]
        self._refit()

    @property
    def settings(self) -> dict[str, Any]:
        """A dict with the name of the predictor, {"name": "kernel_prior"} if `prior` is True, else {"name": "kernel"}."""
        return {"name": "kernel_prior" if self._prior else "kernel"}

    @property
    def scales(self) -> tuple[float, float]:
        """The widths (standard deviations) of the two Gaussian kernels, first the one over poses, then the one over targets.

        The width over poses is a fraction of the spread of each joint's samples (largest minus smallest), the width over targets is in m.
        """
        return self._scales

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, for a target (3,) m. `expected` is not used."""
        super().add(state, target, reward, expected)
        if self._reached.tries >= self._next:
            self._refit()

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """See Independent; the deviation is that of mean rewards from the prior, reduced by the weight of near reaches."""
        known, (by_joints, by_place) = self._reached, self._scales
        near = np.exp(-0.5 * ((known.places - target) ** 2).sum(axis=1) / by_place**2)[known.target] * known.count
        residual = known.mean - self._at_places(known)
        sums = np.stack([np.bincount(known.state, one, len(self._reaches)) for one in (near * residual, near)], axis=1)
        total, weight = (self._alike[JOINTS.index(by_joints)] @ sums).T
        expected = self._expected.mean(target) if self._prior else self._middle
        return expected + total / (weight + PRIOR_WEIGHT), self._spread * np.sqrt(PRIOR_WEIGHT / (weight + PRIOR_WEIGHT))

    def _refit(self) -> None:
        """Fit the prior and choose the scales."""
        known = self._reached
        self._next = known.tries * REFIT
        self._middle, variance = around(known)
        self._expected = DistancePrior(self._reaches, known)
        self._at_place = self._expected.mean(known.places)
        residual = known.mean - self._at_places(known)
        self._spread = float(np.sqrt((residual**2).sum() + variance) / np.sqrt(len(known) + 1.0))
        if len(known) > 1:
            self._scales = self._best(residual)

    def _at_places(self, known: Reached) -> Array:
        """Return the prior reward of each pair, shape (n,)."""
        if not self._prior:
            return np.full(len(known), self._middle)
        for place in known.places[self._at_place.shape[1] :]:
            self._at_place = np.column_stack([self._at_place, self._expected.mean(place)])
        return self._at_place[known.state, known.target]

    def _best(self, residual: Array) -> tuple[float, float]:
        """Return the scales with the least squared error of reaches, each predicted from all others."""
        known = self._reached
        chosen = np.unique(np.linspace(0, len(known) - 1, min(len(known), MAX_LEFT_OUT)).round().astype(np.intp))
        far = ((known.places[known.target[chosen], None] - known.places) ** 2).sum(axis=-1)
        itself = np.arange(len(chosen)), chosen
        found = {}
        for by_place in PLACES:
            near = np.exp(-0.5 * far / by_place**2)[:, known.target] * known.count
            near[itself] = known.count[chosen] - 1.0
            for by_joints, alike in zip(JOINTS, self._alike, strict=True):
                weight = near * alike[np.ix_(known.state[chosen], known.state)]
                error = residual[chosen] - weight @ residual / (weight.sum(axis=1) + PRIOR_WEIGHT)
                found[by_joints, by_place] = float(known.count[chosen] @ error**2)
        return min(found, key=lambda scales: found[scales])
