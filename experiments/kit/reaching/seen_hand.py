# SPDX-License-Identifier: Apache-2.0
"""A robot that sees its hand, and so corrects its encoders, while its reaches are judged by the true position of the hand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Protocol

import numpy as np

from experiments.kit.reaching.arm import MARKER
from experiments.kit.wrapped_plant import WrappedPlant
from mobee import Model
from mobee.arrays import Array
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget
from mobee.robot.robot import Robot
from mobee.vision.calibration.self_calibration import NOISE, JointOffsets, SelfCalibratingPlant


class Judge(ReachPlant, Protocol):
    """A plant that knows the true position of the hand, and so can judge reaches of plants with wrong encoders.

    `reached`: the true position of the marker at the end of the last reach, (3,) m, root frame.
    """

    reached: Array

    def marker_at(self, marker: str) -> Array:
        """Return the true position of the marker now, (3,) m, root frame."""
        ...


class SeenHand:
    """The hand as a learner sees it, and the errors of the encoders that are estimated from the seen positions.

    `offsets`: estimates the errors of the encoders of some motors.  All plants that `correct` returns share it, so the estimates are kept
    when a learner gets a new plant.  `is_seen`: whether the hand is seen at present.
    """

    def __init__(self, robot: Robot, motors: Sequence[str], seed: int) -> None:
        """`motors`: names of the motors whose offsets are unknown.  `seed`: of the errors of the seen positions."""
        self.offsets, self.is_seen = JointOffsets(Model(robot), MARKER, motors), True
        self._rng = np.random.default_rng(seed)

    def see(self, judge: Judge) -> Array | None:
        """Return the position at which the hand is seen, (3,) m, with a random error of 5 mm along each axis; None if it is not seen."""
        error = self._rng.normal(0.0, NOISE, 3)
        return judge.marker_at(MARKER) + error if self.is_seen else None

    def correct(self, judge: Judge) -> JudgedSeeingPlant:
        """Return a plant whose actions move the plant `judge`, and whose encoder values are corrected.

        The corrections are estimated from the positions at which the hand is seen.  `judge`: the plant with wrong encoders.
        """
        return JudgedSeeingPlant(SelfCalibratingPlant(judge, self.offsets, lambda: self.see(judge)), judge)


class JudgedSeeingPlant(WrappedPlant[SelfCalibratingPlant]):
    """A self-calibrating plant whose outcomes of reaches have the true position of the hand and the true remaining error.

    `inner`: the self-calibrating plant.  `judge`: the plant that `inner` moves; it knows the true position of the hand.
    """

    def __init__(self, inner: SelfCalibratingPlant, judge: Judge) -> None:
        super().__init__(inner)
        self._judge, self._target = judge, ReachTarget(np.zeros(3))

    def present(self, target: ReachTarget | None) -> None:
        """Present a target to the self-calibrating plant, or remove it (None); as in `mobee.reach.ReachPlant.present`.

        The last target is kept, also after None: the true error of a reach is computed from it.
        """
        self._target = target or self._target
        super().present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach as `mobee.reach.ReachPlant.reach` does; the outcome has the true position of the marker and the true error that remains.

        `part`, `marker`, `stay`: as in that method.
        """
        found, where = super().reach(part, marker, stay), self._judge.reached
        return replace(found, marker=where, missing=self._target.missing(where))
