# SPDX-License-Identifier: Apache-2.0
"""Predictors that average the rewards of earlier reaches, with larger weights for reaches that are more alike.

`Weighted` is the published predictor: for each state an average, in which nearer targets have more weight (thesis eq. 8.5). `Table` does
not generalise: it stores the mean reward of each state and target. `Kernel` is Nadaraya-Watson kernel regression over poses and targets; it
chooses the widths of its kernels by leave-one-out errors. `Nearest` is nearest-neighbour regression over poses and vectors from hand to
target.
"""

from __future__ import annotations

from typing import Any, NoReturn

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.reaching.histories import Histories, forget
from mobee.learning.reaching.predictors.covariance import joint_squares
from mobee.learning.reaching.predictors.predictor import IMAGINED, DistancePrior, Independent, Reached, around
from mobee.learning.reaching.reaches import Reaches

_NO_DEVIATION = (
    "the published predictor has no deviation and no distribution: explore with intrinsic, greedy or random, or take another predictor."
)

TABLE_NOISE = 0.05  # of `Table`: standard deviation of a reward around its mean, before there are repeats

JOINTS = (0.05, 0.15, 0.3, 0.5, 0.8)  # of `Kernel`: scales of the poses, in units of the spread of the samples
PLACES = (0.03, 0.06, 0.1, 0.15, 0.25)  # of the targets, m
PRIOR_WEIGHT = 0.2  # of the prior at every pose and target, in reaches
REFIT = 1.2  # factor of the number of reaches at which scales and prior are fitted again
MAX_LEFT_OUT = 400  # pairs that are predicted from all others

NEIGHBOURS = 5  # of `Nearest`
LENGTH_SCALE = 0.1  # m, of vectors from hand to target, for a distance of 1
JOINT_WEIGHT = 2.0  # distance between the two ends of a joint's samples
HALF_WEIGHT = 0.05  # squared distance at which a neighbour has half the weight of one at distance 0
SINGLE_TRY = 0.02  # squared distance of equal uncertainty to a pair that was tried once
MAX_SQUARED = 1e6  # squared distance, for uncertainty
AVERAGE_WEIGHT = 0.5  # of the average of all rewards, in neighbours at a squared distance of 1
MAX_CACHED = 256  # targets whose neighbours are in memory


class Weighted:
    """The predictor of the thesis: for each state, the average reward of the reaches from it, in which nearer targets have more weight.

    It is optimistic, because each average includes an imagined reward of 1: the prediction is 1 for a state that was never tried, and
    nearly 1 for targets far from those that were tried.

    Args:
        reaches: the reach actions, one for each state; only their number and `scale`, the unit of distances [m], are used.
    """

    def __init__(self, reaches: Reaches) -> None:
        self._scale = reaches.scale
        self._rewards = Histories(len(reaches), reaches.scale)

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor, and the unit of distances `scale` in m, as JSON values."""
        return {"name": "weighted", "scale": self._scale}

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Append the reward of a reach to the history of its state (thesis eq. 8.2). `target`: (3,) m, root frame; `expected`: unused."""
        self._rewards.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, root frame; shape (S,), thesis eq. 8.5."""
        return self._rewards.average(target, 1.0)

    def deviation(self, target: Array) -> NoReturn:
        """Raise InvalidValue: this predictor has no standard deviations."""
        raise InvalidValue(_NO_DEVIATION)

    def sample(self, target: Array, rng: np.random.Generator) -> NoReturn:
        """Raise InvalidValue: this predictor has no distribution from which to draw a sample."""
        raise InvalidValue(_NO_DEVIATION)


class Table(Independent):
    """Predicts the reward of a reach as a weighted mean of the mean reward of its pair (state, target) and the average over all pairs.

    The fewer rewards a pair has, the more weight the average over all pairs has. The model: the mean rewards of pairs are normally
    distributed around this average, and the rewards of a pair around its mean reward.

    Args:
        reaches: the reach actions, one for each state; only their number is used.
    """

    def __init__(self, reaches: Reaches) -> None:
        super().__init__()
        self._states = len(reaches)

    @property
    def settings(self) -> dict[str, Any]:
        """A dict with one key, "name": the name of the predictor."""
        return {"name": "table"}

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        known = self._reached
        middle, spread = around(known)
        noise = (known.scatter + IMAGINED * TABLE_NOISE**2) / (known.tries - len(known) + IMAGINED)
        count, mean = np.zeros(self._states), np.full(self._states, middle)
        place = known.find(target)
        if place is not None:
            here = known.target == place
            count[known.state[here]], mean[known.state[here]] = known.count[here], known.mean[here]
        precision = 1.0 / spread + count / noise
        return (middle / spread + count * mean / noise) / precision, np.sqrt(1.0 / precision)


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
        """Return means and standard deviations, each (S,), as `Independent` defines them.

        The deviation is the typical difference of mean rewards from the prior mean; the weight of reaches with similar poses and targets
        makes it smaller.
        """
        known, (by_joints, by_place) = self._reached, self._scales
        near = np.exp(-0.5 * ((known.places - target) ** 2).sum(axis=1) / by_place**2)[known.target] * known.count
        residual = known.mean - self._at_places(known)
        sums = np.stack([np.bincount(known.state, one, len(self._reaches)) for one in (near * residual, near)], axis=1)
        total, weight = (self._alike[JOINTS.index(by_joints)] @ sums).T
        expected = self._expected.mean(target) if self._prior else self._middle
        return expected + total / (weight + PRIOR_WEIGHT), self._spread * np.sqrt(PRIOR_WEIGHT / (weight + PRIOR_WEIGHT))

    def _refit(self) -> None:
        """Fit the prior mean and deviation, and choose the widths of the two kernels."""
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
        """Return the prior reward of each observed pair (state, target) of `known`, shape (n,)."""
        if not self._prior:
            return np.full(len(known), self._middle)
        for place in known.places[self._at_place.shape[1] :]:
            self._at_place = np.column_stack([self._at_place, self._expected.mean(place)])
        return self._at_place[known.state, known.target]

    def _best(self, residual: Array) -> tuple[float, float]:
        """Return the widths of the two Gaussian kernels, over poses and over targets [m], that predict the observed rewards best.

        All combinations of JOINTS and PLACES are compared by their squared error, when the mean reward of each pair (state, target) is
        predicted without one of its own reaches; at most MAX_LEFT_OUT pairs are predicted. `residual`: (n,), mean reward of each pair minus
        its prior reward.
        """
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


class Nearest(Independent):
    """Predicts a reward by a weighted average of the five nearest reaches: from similar poses, with similar vectors from hand to target.

    The weights are inverse squared distances; the average of all rewards has a small weight too. Repeated reaches count as one.

    Args:
        reaches: for each state, the pose at which a reach begins, and the marker's position in this pose.
    """

    def __init__(self, reaches: Reaches) -> None:
        super().__init__()
        self._reaches = reaches
        self._joints = joint_squares(reaches).sum(axis=0) * JOINT_WEIGHT**2
        self._found: dict[bytes, tuple[int, Array, Ints]] = {}

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor, as JSON values."""
        return {"name": "nearest"}

    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """Return means and standard deviations, each (S,), as `Independent` defines them.

        The deviation of a state far from all reaches is that of the mean rewards of all pairs; nearer neighbours make it smaller.
        """
        middle, variance = around(self._reached)
        far, which = self._neighbours(target)
        weight = 1.0 / (far + HALF_WEIGHT)
        rewards = np.append(self._reached.mean, middle)[which]
        mean = (AVERAGE_WEIGHT * middle + (weight * rewards).sum(axis=1)) / (AVERAGE_WEIGHT + weight.sum(axis=1))
        uncertainty = np.minimum(far[:, 0], MAX_SQUARED) + SINGLE_TRY / np.append(self._reached.count, 1.0)[which[:, 0]]
        deviation: Array = np.sqrt(variance * uncertainty / (1.0 + uncertainty))
        return mean, deviation

    def _neighbours(self, target: Array) -> tuple[Array, Ints]:
        """Return the squared distances of the five nearest reaches of each state, nearest first, and their numbers, each (S, 5).

        The number of a reach is the index of its pair (state, target). If there are fewer than five, the distances are infinite, and the
        numbers -1.
        """
        key = target.tobytes()
        none = np.full((len(self._reaches), NEIGHBOURS), np.inf), np.full((len(self._reaches), NEIGHBOURS), -1)
        seen, far, which = self._found.pop(key, (0, *none))
        if seen < len(self._reached):
            known, hands = self._reached, self._reaches.hands
            new = slice(seen, len(known))
            state, vectors = known.state[new], known.places[known.target[new]] - hands[known.state[new]]
            squares = self._joints[:, state]
            for axis in range(3):
                squares += ((target[axis] - hands[:, axis, None] - vectors[:, axis]) / LENGTH_SCALE) ** 2
            far = np.concatenate([far, squares], axis=1)
            which = np.concatenate([which, np.broadcast_to(np.arange(seen, len(known)), squares.shape)], axis=1)
            order = np.argsort(far, axis=1, kind="stable")[:, :NEIGHBOURS]
            far, which = np.take_along_axis(far, order, axis=1), np.take_along_axis(which, order, axis=1)
        forget(self._found, MAX_CACHED)
        self._found[key] = len(self._reached), far, which
        return far, which
