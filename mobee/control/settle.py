"""When an action is over: the motion of a part has died down, or its time is up (thesis 6.1)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.control.layout import MOVING, SETTLED, TIMED_OUT
from mobee.control.load import law
from mobee.errors import InvalidValue
from mobee.robot.robot import Array

Verdict = Literal["moving", "settled", "timeout"]
_VERDICTS: dict[int, Verdict] = {MOVING: "moving", SETTLED: "settled", TIMED_OUT: "timeout"}


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

    @property
    def numbers(self) -> Array:
        """As the compiled test reads them, (5,)."""
        return np.array([self.speed, self.acceleration, self.first_look, self.interval, self.timeout])


class SettleTest:
    """One action's test: looks at the commanded motion now and then, as the original's poll did."""

    def __init__(self, settle: Settle, start: float) -> None:
        """Begin at time `start` [s]."""
        self.settle = settle
        self._numbers = settle.numbers
        self._memory = np.array([start, start + settle.first_look])

    def look(self, t: float, speeds: Array, accelerations: Array) -> Verdict:
        """Judge the part's motion at time t [s]; between two looks the answer is always "moving".

        `speeds` rad/s and `accelerations` rad/s^2: what the controller commands the part's motors, shape (n_part,); of motors that
        slide divided by their `fine_units`.
        """
        return _VERDICTS[law().look(self._numbers, self._memory, t, np.array([speeds, accelerations], dtype=np.float64))]
