"""Actions in progress on an offline plant: which motors are active, what is touched, how each action ended."""

from __future__ import annotations

from itertools import compress

import numpy as np
from numpy.typing import NDArray

from mobee._core.plant import PART
from mobee._core.tables import Table
from mobee.arrays import Array, real_array
from mobee.control.gains import VERDICTS
from mobee.errors import InvalidValue
from mobee.plant import Outcome
from mobee.robot.robot import Robot

_FLOAT = np.dtype(np.float64)
_SETTLED = VERDICTS.index("settled")


class Actions:
    """`parts`: a row for each part, see `mobee._core.plant.PART`, which a plant's ticks read and change."""

    __slots__ = ("_alive", "_begun", "_limits", "_next_look", "_parts", "_row", "_under_way", "_verdict", "parts")

    def __init__(self, robot: Robot, alive: NDArray[np.bool_]) -> None:
        self._parts, self._row = robot.parts, {name: row for row, name in enumerate(robot.parts)}
        self._alive = {name: bool(alive[part.slice].any()) for name, part in robot.parts.items()}
        self._limits = {name: robot.limits[part.slice].tolist() for name, part in robot.parts.items()}
        self.parts: Table = np.zeros(len(self._row), dtype=PART)
        self.parts["motors"] = [(part.start, part.start + len(part)) for part in robot.parts.values()]
        self._begun, self._next_look = self.parts["begun"], self.parts["next_look"]
        self._under_way, self._verdict = self.parts["under_way"], self.parts["verdict"]

    @property
    def under_way(self) -> tuple[str, ...]:
        """The parts that act, in their order."""
        return tuple(compress(self._parts, self._under_way.tolist()))

    def require_possible(self, part: str, target: Array) -> None:
        """Raise InvalidValue if no motor of a part lives, or if a target with a number for each of its motors is outside their limits."""
        if not self._alive[part]:
            raise InvalidValue(f"{part} cannot act: none of its motors is active in this plant; name it in active=[...]")
        values = target if type(target) is np.ndarray and target.dtype is _FLOAT else real_array(f"target for {part}", target)
        motors = self._parts[part].motors
        if values.shape != (len(motors),):
            return
        for at, (low, high), motor in zip(values.tolist(), self._limits[part], motors, strict=True):
            if not low <= at <= high:
                raise InvalidValue(f"target {at:.4g} rad for {motor}: must be within {low:.4g} to {high:.4g} rad")

    def begin(self, part: str, asked: float, first_look: float) -> None:
        """Start a part's settle test, asked for at a time [s]; it is looked at `first_look` s later first."""
        row = self._row[part]
        self._begun[row], self._next_look[row], self._under_way[row] = asked, asked + first_look, 1

    def end_all(self) -> None:
        """Forget what is under way."""
        self._under_way[:] = 0

    def outcome(self, part: str, q: Array, sampled: float, touched: tuple[str, ...]) -> Outcome:
        """How a part's last action ended, by the encoders q (n,) rad read at time `sampled` [s], in contact with these objects."""
        row = self._row[part]
        settled = bool(self._verdict[row] == _SETTLED)
        return Outcome(q[self._parts[part].slice].copy(), settled, sampled - float(self._begun[row]), touched)
