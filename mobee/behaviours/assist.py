# SPDX-License-Identifier: Apache-2.0
"""Torso assist: moves the base of an arm so that the target is at a place that the arm reaches well (thesis 9.4.2).

The worth of a place is a number: how well the arm reaches the place with its base link at home. It is the reward that a reach learner
predicts, trained with the torso at home, or the manipulability of the arm. For another posture of the base, the position of the target
relative to the base is computed; its worth is that of the place with the same position relative to the base at home.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from mobee.arrays import Array, checked_count
from mobee.control.forces import checked
from mobee.errors import InvalidValue
from mobee.learning.reaching.predictors import RewardPredictor
from mobee.model.kinematics import link_transforms, tables
from mobee.model.model import Model
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import Robot

Worth = Callable[[Array], Array]
"""A function that takes places (k, 3) m, root frame, and returns how well an arm at home reaches them: (k,) numbers, at most 1.

A number below 0 means out of reach.
"""

LEVELS = 7  # positions of each motor that are compared
INSIDE = np.deg2rad(10.0)  # rad before each limit that are not used, at most a quarter of the range
EFFORT = 0.1  # per rad^2: cost of a motion
LEAST_GAIN = 0.05  # by which another posture must be better, so that the part does not move for a little
SAMPLES, SPREAD = 4000, 0.05  # postures of the arm; m, over which the manipulability of a posture is spread


@dataclass(frozen=True, slots=True, eq=False)
class Assistance:
    """The result of `Assist.posture`.

    `q`: (n_part,) rad, the posture to which the part that carries the arm should move. `worth`: a number for how well the arm reaches the
    target from this posture. `worth_now`: the same for the present posture. Both are at most 1; a number below 0 means out of reach.
    """

    q: Array
    worth: float
    worth_now: float


class Assist:
    """Chooses postures of a part that carries an arm, such as the torso, from which the arm reaches a target well."""

    def __init__(self, model: Model, part: str, arm: str, worth: Worth, levels: int = LEVELS) -> None:
        """Prepare the postures that are compared: a grid over the motors of the part.

        Args:
            model: the robot in its world, for the contacts.
            part: the part that carries the arm and may move, such as "torso".
            arm: the part that reaches.
            worth: how well the arm reaches places (k, 3) m with its base at home.
            levels: number of positions of each motor in the grid, at least 2.

        Raises:
            InvalidValue: the part does not carry the arm, or `levels` is not valid.
            UnknownName: the robot does not have the part or the arm.
        """
        levels = checked_count("levels", levels, 2)
        self.model, self.part = model, model.robot.part(part)
        self._worth, self._base = worth, base_link(model.robot, arm)
        robot, span = model.robot, self.part.slice
        if not (robot.coupling[0][tables(robot).ancestry[self._base]][:, span] != 0.0).any():
            raise InvalidValue(f"{part} of {robot.name!r} does not carry {arm}: name a part that moves {robot.links[self._base]}")
        self._home = link_transforms(robot, robot.home)[self._base]
        low, high = robot.limits[span].T
        self._units = motor_units(robot)[span]
        spare = np.minimum(INSIDE * self._units, 0.25 * (high - low))
        compared = [np.linspace(a, b, levels) for a, b in zip(low + spare, high - spare, strict=True)]
        self._postures = np.stack(np.meshgrid(*compared, indexing="ij"), axis=-1).reshape(-1, len(compared))

    def posture(self, q: Array, target: Array) -> Assistance:
        """Return the best posture of the part for a target (3,) m, root frame; all other motors stay as in the posture q (n,) rad.

        The score of a posture is the worth of the target (how well the arm reaches it from this posture, at most 1), minus 0.1 per rad^2 of
        motion. For a motor that slides, 1 rad is the length of `mobee.robot.motor_units.motor_units`. The result is the posture with the
        highest score among those without contacts of solids whose score is more than 0.05 above that of the present posture; if there is
        none, the present posture. Raises InvalidValue for a wrong shape, and for numbers that are not finite.
        """
        q, target, span = checked("q", q, len(self.model.robot.motors)), checked("target", target, 3), self.part.slice
        postures = np.concatenate([q[None, span], self._postures])
        whole = np.repeat(q[None], len(postures), axis=0)
        whole[:, span] = postures
        moved = link_transforms(self.model.robot, whole)[:, self._base]
        seen = np.linalg.solve(moved, np.append(target, 1.0)[None, :, None])  # the target as the base link at zero pose sees it
        worth = self._worth((self._home @ seen)[:, :3, 0])
        score = worth - EFFORT * (((postures - q[span]) / self._units) ** 2).sum(axis=1)
        order = np.argsort(-score, kind="stable")
        better = order[score[order] > score[0] + LEAST_GAIN]
        free = better[np.asarray(self.model.evaluate(whole[better]).count) == 0] if len(better) else better
        best = int(free[0]) if len(free) else 0
        return Assistance(postures[best], float(worth[best]), float(worth[0]))


def base_link(robot: Robot, arm: str) -> int:
    """Return the index of the parent link of the first joint of the part `arm`.

    Raises UnknownName if there is no such part, InvalidValue if it moves no joint.
    """
    span = robot.part(arm).slice
    driven = (robot.coupling[0][:, span] != 0.0).any(axis=1)
    if not driven.any():
        raise InvalidValue(f"{arm} of {robot.name!r} moves no joint: give a part with motors that do")
    return robot.joints[int(np.flatnonzero(driven)[0])].parent


def learned_worth(predictor: RewardPredictor) -> Worth:
    """Return a function of places (k, 3) m, root frame: the largest reward that a reach learner predicts for a target at each, (k,).

    `predictor`: the learner's predictor of rewards; the largest reward is taken over all states of the learner.
    """
    return lambda places: np.array([float(predictor.mean(place).max()) for place in places])


def manipulability_worth(robot: Robot, arm: str, marker: str, seed: int = 0) -> Worth:
    """Return a function of places (k, 3) m, root frame: the arm's manipulability sqrt(det J J^T) near each place, (k,).

    It is given as a share of its maximum. Unlike `learned_worth` it needs no learner. The manipulability is computed in random postures;
    postures in which the robot touches itself are ignored. For a place that is not near the marker (5 cm) in any posture, the value is
    minus its distance [m] from the nearest position of the marker.

    Args:
        robot: the robot, whose other parts are at home.
        arm: the part that reaches.
        marker: name of the marker with which the arm reaches.
        seed: seed of the random postures.

    Raises:
        InvalidValue: in all random postures the robot touches itself, or the arm cannot move the marker in all three directions.
    """
    model, span = Model(robot), robot.part(arm).slice
    q = np.repeat(robot.home[None], SAMPLES, axis=0)
    low, high = robot.limits[span].T
    q[:, span] = np.random.default_rng(seed).uniform(low, high, size=(SAMPLES, len(low)))
    q = q[np.asarray(model.evaluate(q).count) == 0]
    jacobian = model.jacobian(q, marker)[:, :3, span]
    dexterity = np.sqrt(np.maximum(np.linalg.det(jacobian @ np.swapaxes(jacobian, 1, 2)), 0.0))
    if not (dexterity > 0.0).any():
        raise InvalidValue(f"{arm} cannot move {marker} in three directions in any posture without contact: give another arm or marker.")
    tree, dexterity = cKDTree(model.evaluate(q).position(marker)), dexterity / dexterity.max()

    def worth(places: Array) -> Array:
        distance, index = tree.query(places, k=range(1, min(16, len(q)) + 1))
        near = (dexterity[index] * np.maximum(0.0, 1.0 - (distance / SPREAD) ** 2)).max(axis=1)
        return np.asarray(np.where(near > 0.0, near, -distance[:, 0]), dtype=np.float64)

    return worth
