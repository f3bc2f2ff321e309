"""Decides when an action ends: the part has settled, or time is up (thesis 6.1)."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee._core import law as core
from mobee.arrays import Array
from mobee.errors import InvalidValue

Verdict = Literal["moving", "settled", "timeout"]
VERDICTS: tuple[Verdict, ...] = ("moving", "settled", "timeout")
"""In the order of the core's."""


@dataclass(frozen=True, slots=True)
class Settle:
    """The thresholds of the settle test: physics, not bookkeeping (they set which states are hard to reach).

    A part is settled when every motor is commanded at most `speed` and accelerated at most `acceleration`; of a motor that slides
    both count in its fine unit (`mobee.robot.motor_units`): 3 deg/s are 0.4 % of its range a second.
    """

    speed: float  # rad/s
    acceleration: float  # rad/s^2
    first_look: float = 1.0  # s after the start of the action
    interval: float = 0.2  # s between looks
    timeout: float = 20.0  # s

    def __post_init__(self) -> None:
        for name in ("speed", "acceleration", "interval", "timeout"):
            if not 0 < getattr(self, name) < np.inf:
                raise InvalidValue(f"settle {name} {getattr(self, name)}: must be finite and above 0")
        if not 0 <= self.first_look < np.inf:
            raise InvalidValue(f"settle first_look {self.first_look} s: must be a finite time, not negative")


class SettleTest:
    """One action's test: looks at the commanded motion now and then, as the original's poll did."""

    def __init__(self, settle: Settle, start: float) -> None:
        """Begin at time `start` [s]."""
        self.settle = settle
        self._thresholds = core.Settle(*(getattr(settle, name) for name in core.SETTLE))
        self._memory = core.SettleTest(start, start + settle.first_look)
        self._look = core.calls().look

    def look(self, t: float, speeds: Array, accelerations: Array) -> Verdict:
        """Judge the part's motion at time t [s]; between two looks the answer is always "moving".

        `speeds` rad/s and `accelerations` rad/s^2: what the controller commands the part's motors, shape (n_part,); of motors that
        slide divided by their `fine_units`.
        """
        motion = np.array([speeds, accelerations], dtype=np.float64)
        found: int = self._look(ctypes.byref(self._thresholds), ctypes.byref(self._memory), t, motion.tobytes(), motion.shape[1])
        return VERDICTS[found]
