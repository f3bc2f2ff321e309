"""The live arm as the planner peer drives it."""

from __future__ import annotations

import numpy as np

from experiments.live_reach.performer.hand import Hand
from experiments.live_reach.settings import PART
from mobee import Model
from mobee.plant import Outcome
from mobee.reach import ReachTarget
from mobee.robot.robot import Array


class PeerPlant:
    """Motions through MoBeE; the target repels nothing meanwhile, for who sends the arm there has planned around it."""

    def __init__(self, hand: Hand, tick: float) -> None:
        """`tick`: s."""
        self.robot, self.ends = hand.robot, list[int]()
        """Ticks at which the marker was to be at the target."""
        self._hand, self._model, self._dt = hand, Model(hand.robot), tick
        self._target: ReachTarget | None = None

    @property
    def time(self) -> float:
        """Of the robot, s."""
        return self._hand.tick * self._dt

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self._hand.measure(part)

    def go(self, part: str, target: Array, marker: str) -> Outcome:
        """See JudgedPlant."""
        self._hand.present(None)
        return self._hand.act(part, target)

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self._target = target
        self._hand.present(target)

    def missing(self, marker: str) -> float:
        """How far the marker is from the target by the encoders, now; m."""
        self.ends.append(self._hand.tick)
        whole = self.robot.home.copy()
        whole[self.robot.part(PART).slice] = self.measure(PART)
        target = self._target
        return np.inf if target is None else target.missing(self._model.evaluate(whole).position(marker))
