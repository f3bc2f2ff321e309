"""The actions under way on an offline plant: which parts act, and how each ended, as the compiled loop judges them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mobee._core import law as law_core
from mobee._core.plant import PART
from mobee._core.tables import Table
from mobee.collision.touch import touched_by
from mobee.plant import Outcome
from mobee.robot.robot import Array, Robot

if TYPE_CHECKING:
    from mobee.pose import Pose


class Actions:
    """`parts`: a row for each part, see `mobee._core.plant.PART`, which a plant's ticks read and change."""

    __slots__ = ("_names", "parts")

    def __init__(self, robot: Robot) -> None:
        self._names = tuple(robot.parts)
        self.parts: Table = np.zeros(len(self._names), dtype=PART)
        for row, part in zip(self.parts, robot.parts.values(), strict=True):
            row["motors"] = part.start, part.start + len(part)

    @property
    def under_way(self) -> tuple[str, ...]:
        """The parts that act, in their order."""
        return tuple(self._names[p] for p in np.flatnonzero(self.parts["under_way"]))

    def begin(self, part: str, asked: float, first_look: float) -> None:
        """Start a part's settle test, asked for at a time [s]; it is looked at `first_look` s later first."""
        row = self.parts[self._names.index(part)]
        row["begun"], row["next_look"], row["under_way"] = asked, asked + first_look, 1

    def end_all(self) -> None:
        """Forget what is under way."""
        self.parts["under_way"] = 0

    def outcome(self, part: str, q: Array, sampled: float, pose: Pose) -> Outcome:
        """How a part's last action ended, by the encoders q (n,) rad read at time `sampled` [s]."""
        row = self.parts[self._names.index(part)]
        first, end = row["motors"].item()
        settled = law_core.VERDICTS[row["verdict"]] == "settled"
        return Outcome(q[first:end].copy(), settled, sampled - float(row["begun"]), touched_by(pose, part))
