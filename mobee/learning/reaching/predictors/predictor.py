# SPDX-License-Identifier: Apache-2.0
"""The interface of predictors of the rewards of reaches, and their common parts: a memory of rewards, a base class, a prior mean.

`Reached` stores the reaches observed so far, with repeated ones merged. `Independent` is the base of predictors that treat states as
independent. `DistancePrior` is a prior mean reward from the distance between hand and target.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, Protocol, runtime_checkable

import numpy as np

from mobee.arrays import Array, Ints
from mobee.learning.reaching.histories import grown
from mobee.learning.reaching.reaches import Reaches

EXPECTED, SPREAD = 0.3, 0.25  # average and standard deviation of mean rewards before the first reach
IMAGINED = 4.0  # weight of these two, in pairs

KNOTS = np.linspace(0.0, 0.6, 13)  # m, distances between hand and target
SMOOTHNESS = 2.0  # weight of equal values at neighbouring knots, in reaches
SHRINKAGE = 0.1  # weight of the average of all rewards at each knot, in reaches


@runtime_checkable
class RewardPredictor(Protocol):
    """The interface of predictors: predicts the reward of a reach from each of S states for any target.

    Predictions must depend only on the settings and the sequence of calls of `add`, so that they can be rebuilt from a record; all other
    methods change nothing. Targets are positions (3,) m, root frame; there may be any number of different ones.
    """

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, for a target (3,) m.

        `expected`: the reward that `mean` predicted just before.
        """
        ...

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, shape (S,)."""
        ...

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation of the expected reward of a reach from each state for a target (3,) m, shape (S,).

        Raises InvalidValue if the predictor has no deviations.
        """
        ...

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return a random sample, from the predictor's distribution, of the mean reward of a reach from each state, shape (S,).

        `target`: (3,) m. Raises InvalidValue if the predictor has no distribution.
        """
        ...

    @property
    def settings(self) -> dict[str, Any]:
        """The name of the predictor and the settings that determine its predictions, as JSON values."""
        ...


@runtime_checkable
class WorldComparer(Protocol):
    """Additional interface of a predictor that estimates to what degree rewards from another world are valid in the present one.

    Worlds differ in their objects, such as obstacles, or in the robot.
    """

    def begin_world(self) -> None:
        """Predict from now on for another world or another robot, in which all later reaches are made."""
        ...


def begin_world(predictor: RewardPredictor) -> None:
    """Report to a predictor that all later reaches are made in another world, or on another robot.

    A predictor that is not a `WorldComparer` treats all rewards as rewards of one world.
    """
    if isinstance(predictor, WorldComparer):
        predictor.begin_world()


class Independent(ABC):
    """Base of predictors for which the mean rewards of reaches from different states are independent normal variables.

    A subclass defines `_posterior`, which returns the means and standard deviations of these variables for a given target, each (S,). It
    computes them from `_reached` (a `Reached`), where `add` records all observed reaches.
    """

    def __init__(self) -> None:
        self._reached = Reached()

    @property
    @abstractmethod
    def settings(self) -> dict[str, Any]:
        """The name of the predictor and the settings that determine its predictions, as JSON values."""

    def add(self, state: int, target: Array, reward: float, expected: float) -> None:
        """Learn from the reward of a reach that began in `state`, for a target (3,) m, root frame. `expected` is not used."""
        self._reached.add(state, target, reward)

    def mean(self, target: Array) -> Array:
        """Return the expected reward of a reach from each state for a target (3,) m, root frame; shape (S,)."""
        return self._posterior(target)[0]

    def deviation(self, target: Array) -> Array:
        """Return the standard deviation of the mean reward of a reach from each state for a target (3,) m, root frame; shape (S,)."""
        return self._posterior(target)[1]

    def sample(self, target: Array, rng: np.random.Generator) -> Array:
        """Return a random sample of the mean reward of a reach from each state, shape (S,); the states are drawn independently.

        `target`: (3,) m, root frame.
        """
        drawn: Array = rng.normal(*self._posterior(target))
        return drawn

    @abstractmethod
    def _posterior(self, target: Array) -> tuple[Array, Array]:
        """Return means and standard deviations of the mean rewards of the states for a target (3,) m, root frame, each (S,).

        The caller may change the arrays.
        """


class Reached:
    """The reaches observed so far, by pair of state and target: the number, the sum and the sum of squares of the rewards of each pair.

    The pairs are in the order of their first reaches. Reaches in different worlds, or on different robots, form different pairs: each pair
    has the number of its world.
    """

    def __init__(self) -> None:
        self._target_of: dict[bytes, int] = {}
        self._pair_of: dict[tuple[int, int, int], int] = {}
        self._places = np.empty((8, 3))
        self._state, self._target, self._world = (np.empty(8, dtype=np.intp) for _ in range(3))
        self._count, self._total, self._squares = np.zeros(8), np.zeros(8), np.zeros(8)
        self.tries = 0
        """Number of reaches so far; repeated ones count each time."""

    def __len__(self) -> int:
        return len(self._pair_of)

    @property
    def places(self) -> Array:
        """The positions of the distinct targets, shape (T, 3), in [m], root frame."""
        return self._places[: len(self._target_of)]

    @property
    def state(self) -> Ints:
        """The state of each pair of state and target, shape (n,)."""
        return self._state[: len(self)]

    @property
    def target(self) -> Ints:
        """The target of each pair of state and target, as an index into `places`, shape (n,)."""
        return self._target[: len(self)]

    @property
    def world(self) -> Ints:
        """The number of the world of each pair of state and target, shape (n,)."""
        return self._world[: len(self)]

    @property
    def count(self) -> Array:
        """The number of reaches observed for each pair of state and target, shape (n,)."""
        return self._count[: len(self)]

    @property
    def mean(self) -> Array:
        """The average reward of each pair of state and target, shape (n,)."""
        average: Array = self._total[: len(self)] / self.count
        return average

    @property
    def scatter(self) -> float:
        """The sum over all reaches of the squared difference between the reward and the average reward of its state and target."""
        within = self._squares[: len(self)] - self._total[: len(self)] ** 2 / self.count
        return float(np.maximum(within, 0.0).sum())

    def find(self, target: Array) -> int | None:
        """Return the index of a target (3,) m, root frame, in `places`; None if it was never tried."""
        return self._target_of.get(target.tobytes())

    def pair(self, state: int, target: Array, world: int = 0) -> int | None:
        """Return the index of a pair of a state and a target (3,) m, root frame; None if the pair was never tried in this world."""
        known = self.find(target)
        return None if known is None else self._pair_of.get((state, known, world))

    def add(self, state: int, target: Array, reward: float, world: int = 0) -> int:
        """Record one reach that began in `state`, for a target (3,) m in the root frame, and its reward; return the index of its pair.

        A pair is a state and a target in one world (the surroundings or the robot of the reach). `world`: number of the world. The first
        reach of a pair adds the pair at the end.
        """
        key = target.tobytes()
        place = self._target_of.setdefault(key, len(self._target_of))
        self._places = grown(self._places, place)
        self._places[place] = target
        pair = self._pair_of.setdefault((state, place, world), len(self._pair_of))
        self._state, self._target, self._world = grown(self._state, pair), grown(self._target, pair), grown(self._world, pair)
        self._count, self._total, self._squares = grown(self._count, pair), grown(self._total, pair), grown(self._squares, pair)
        self._state[pair], self._target[pair], self._world[pair] = state, place, world
        self._count[pair] += 1.0
        self._total[pair] += reward
        self._squares[pair] += reward * reward
        self.tries += 1
        return pair


def around(known: Reached) -> tuple[float, float]:
    """Return the average and the variance of the average rewards of all pairs of state and target.

    Four imagined pairs, with average 0.3 and standard deviation 0.25, are included, so that both results exist before the first reach.
    """
    rewards, pairs = known.mean, len(known) + IMAGINED
    middle = (rewards.sum() + IMAGINED * EXPECTED) / pairs
    return float(middle), float((((rewards - middle) ** 2).sum() + IMAGINED * SPREAD**2) / pairs)


class DistancePrior:
    """The expected reward as a function of the distance between hand and target, fitted to all reaches that were observed (`known`).

    It is linear between KNOTS (every 5 cm up to 0.6 m), and constant beyond the last of them.
    """

    def __init__(self, reaches: Reaches, known: Reached) -> None:
        self._reaches = reaches
        middle, _ = around(known)
        weights = _shares(np.linalg.norm(known.places[known.target] - reaches.hands[known.state], axis=1))
        step = np.diff(np.eye(len(KNOTS)), axis=0)
        square = (weights.T * known.count) @ weights + SMOOTHNESS * step.T @ step + SHRINKAGE * np.eye(len(KNOTS))
        self._values = np.linalg.solve(square, (weights.T * known.count) @ known.mean + SHRINKAGE * middle)

    def mean(self, target: Array) -> Array:
        """Return the expected rewards of reaches from each state for a target (3,) m, shape (S,), or for targets (T, 3), shape (S, T)."""
        far = lengths(self._reaches, target)
        expected: Array = np.interp(far, KNOTS, self._values)
        return expected


def lengths(reaches: Reaches, target: Array) -> Array:
    """Return the distance [m] between the hand in each state and a target (3,) m, root frame, shape (S,); for targets (T, 3), (S, T)."""
    far: Array = np.sqrt(((target - reaches.hands.reshape(-1, *[1] * (target.ndim - 1), 3)) ** 2).sum(axis=-1))
    return far


def _shares(far: Array) -> Array:
    """Return the weights of the KNOTS (fixed distances) in a linear interpolation at each distance [m] of `far`, shape (n, knots)."""
    shares: Array = np.stack([np.interp(far, KNOTS, one) for one in np.eye(len(KNOTS))], axis=-1).reshape(-1, len(KNOTS))
    return shares
