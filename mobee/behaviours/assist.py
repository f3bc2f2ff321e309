# SPDX-License-Identifier: Apache-2.0
"""Torso assist: moves the base of an arm so that the target is where the arm reaches well (thesis 9.4.2).

How well it reaches is a function of the place in the frame of the arm's base link with that link at home: the map of a reach learner, which
has learned with the torso at home, or the manipulability of the arm.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors import RewardPredictor
from mobee.model.kinematics import link_transforms, tables
from mobee.model.model import Model
from mobee.robot.robot import Robot

Worth = Callable[[Array], Array]
"""How well an arm reaches for places (k, 3) m, with its base at home: (k,) numbers, at most 1; below 0 out of reach."""

LEVELS = 7  # positions of each motor that are compared
INSIDE = np.deg2rad(10.0)  # rad before each limit that are not used, at most a quarter of the range
EFFORT = 0.1  # per rad^2: cost of a motion
LEAST_GAIN = 0.05  # by which another posture must be better, so that the part does not move for a little
SAMPLES, SPREAD = 4000, 0.05  # postures of the arm; m, over which the manipulability of a posture is spread


@dataclass(frozen=True, slots=True, eq=False)
class Assistance:
    """Where the part should be, `q` (n_part,) rad, and how well the arm reaches from there and from the present posture."""

    q: Array
    worth: float
    worth_now: float


class Assist:
    """Chooses postures of a part that carries an arm."""

    def __init__(self, model: Model, part: str, arm: str, worth: Worth, levels: int = LEVELS) -> None:
        """`part`: that moves, such as "torso"; `arm`: the part that reaches; `levels`: positions of each motor that are compared.

        Raises InvalidValue if the part does not carry the arm, and UnknownName.
        """
        self.model, self.part = model, model.robot.part(part)
        self._worth, self._base = worth, base_link(model.robot, arm)
        robot, span = model.robot, self.part.slice
        if not (robot.coupling[0][tables(robot).ancestry[self._base]][:, span] != 0.0).any():
            raise InvalidValue(f"{part} of {robot.name!r} does not carry {arm}: name a part that moves {robot.links[self._base]}")
        self._home = link_transforms(robot, robot.home)[self._base]
        low, high = robot.limits[span].T
        spare = np.minimum(INSIDE, 0.25 * (high - low))
        compared = [np.linspace(a, b, levels) for a, b in zip(low + spare, high - spare, strict=True)]
        self._postures = np.stack(np.meshgrid(*compared, indexing="ij"), axis=-1).reshape(-1, len(compared))

    def posture(self, q: Array, target: Array) -> Assistance:
        """Return where the part should be for a target (3,) m, with all other motors at q (n,) rad.

        Postures in which solids touch are left out; the part stays where it is if no other is better by LEAST_GAIN.
        """
        span = self.part.slice
        postures = np.concatenate([q[None, span], self._postures])
        whole = np.repeat(q[None], len(postures), axis=0)
        whole[:, span] = postures
        moved = link_transforms(self.model.robot, whole)[:, self._base]
        seen = np.linalg.solve(moved, np.append(target, 1.0)[None, :, None])  # the target as the base link at zero pose sees it
        worth = self._worth((self._home @ seen)[:, :3, 0])
        score = worth - EFFORT * ((postures - q[span]) ** 2).sum(axis=1)
        order = np.argsort(-score, kind="stable")
        better = order[score[order] > score[0] + LEAST_GAIN]
        free = better[np.asarray(self.model.evaluate(whole[better]).count) == 0] if len(better) else better
        best = int(free[0]) if len(free) else 0
        return Assistance(postures[best], float(worth[best]), float(worth[0]))


def base_link(robot: Robot, arm: str) -> int:
    """Return the link that carries the first joint of a part; raises UnknownName."""
    span = robot.part(arm).slice
    driven = (robot.coupling[0][:, span] != 0.0).any(axis=1)
    return robot.joints[int(np.flatnonzero(driven)[0])].parent


def learned_worth(predictor: RewardPredictor) -> Worth:
    """Return a function of places: the largest reward that a reach learner predicts for a target there, over all states of its space."""
    return lambda places: np.array([float(predictor.mean(place).max()) for place in places])


def manipulability_worth(robot: Robot, arm: str, marker: str, seed: int = 0) -> Worth:
    """Return a function of places (k, 3) m: the manipulability sqrt(det J J^T) of the arm near each, relative to the largest.

    Unlike `learned_worth` it needs no learner.

    It is taken from random postures; those in which the robot touches itself do not count.  A place that is near to none of them has
    minus its distance [m] from the nearest one.

    Args:
        robot: the robot, whose other parts are at home.
        arm: the part that reaches.
        marker: that it reaches with.
        seed: of the postures.
    """
    model, span = Model(robot), robot.part(arm).slice
    q = np.repeat(robot.home[None], SAMPLES, axis=0)
    low, high = robot.limits[span].T
    q[:, span] = np.random.default_rng(seed).uniform(low, high, size=(SAMPLES, len(low)))
    q = q[np.asarray(model.evaluate(q).count) == 0]
    jacobian = model.jacobian(q, marker)[:, :3, span]
    dexterity = np.sqrt(np.maximum(np.linalg.det(jacobian @ np.swapaxes(jacobian, 1, 2)), 0.0))
    tree, dexterity = cKDTree(model.evaluate(q).position(marker)), dexterity / dexterity.max()

    def worth(places: Array) -> Array:
        distance, index = tree.query(places, k=16, distance_upper_bound=np.inf)
        near = (dexterity[index] * np.maximum(0.0, 1.0 - (distance / SPREAD) ** 2)).max(axis=1)
        return np.asarray(np.where(near > 0.0, near, -distance[:, 0]), dtype=np.float64)

    return worth
