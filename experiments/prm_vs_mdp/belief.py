"""What a planner believes of robot and world, and which poses and motions it therefore holds for sound."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from experiments.kit.arm_learning import arm_clauses, clear, columns, robot
from experiments.prm_vs_mdp.scene import Scene, world_of
from mobee import Gains, Model
from mobee.robot.robot import Array, Clause

BELIEFS = ("true", "no cables", "miscalibrated", "both", "gross")
STEP = 0.02  # of a joint's range, between two poses of a motion that are looked at


class Belief:
    """Sound is a pose of the arm that is, as far as is believed, clear of contacts and cables.

    Args:
        model: the robot in the world, as believed.
        turns: (4,) rad, by how much the joints are believed to stand elsewhere than the encoders say.
        clauses: the rows of cables that are known.
    """

    def __init__(self, model: Model, turns: Array, clauses: Sequence[Clause]) -> None:
        self._model, self._turns, self._clauses = model, turns, clauses
        limits = robot().limits[columns()]
        self.limits: Array = limits + np.array([1.0, -1.0]) * Gains.published_2014().limit_width
        """(4, 2) rad between which the joint limits exert no force."""
        self.span: Array = np.ptp(limits, axis=1)
        """(4,) rad, the joints' ranges."""
        self.looks = 0
        """How many poses were looked at."""

    def sound(self, q: Array, cables: bool = True) -> NDArray[np.bool_]:
        """Which of the poses (P, 4) rad are; `cables`: whether they count."""
        self.looks += len(q)
        return clear(self._model, q + self._turns, self._clauses if cables else ())

    def is_sound_motion(self, start: Array, end: Array, cables: bool = True) -> bool:
        """Whether all of the straight way between two poses (4,) rad is; where it starts does not count, for there the robot is."""
        count = max(1, int(np.ceil(np.abs((end - start) / self.span).max() / STEP)))
        shares = np.arange(1, count + 1)[:, None] / count
        return bool(self.sound(start + shares * (end - start), cables).all())


def believed(scene: Scene, kind: str) -> Belief:
    """A belief about a scene, of one of the BELIEFS.

    "true", or what is hidden: "no cables" (the rows of the shoulder's cables), "miscalibrated" (balls 1 cm and joints 3
    degrees off), "both", "gross" (both, three times as much off).
    """
    times = {"miscalibrated": 1.0, "both": 1.0, "gross": 3.0}.get(kind, 0.0)
    clauses = [] if kind in ("no cables", "both", "gross") else arm_clauses()
    return Belief(Model(robot(), world_of(scene.balls + times * scene.shifts)), times * scene.turns, clauses)
