"""The actions under way on an offline plant: which parts act, and how each ended, as the compiled loop judges them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from mobee.collision.touch import touched_by
from mobee.control.layout import SETTLED
from mobee.plant import Outcome
from mobee.robot.robot import Array, Ints, Robot
from mobee.simulation.layout import ACTING, FIRST, PART, STOP, VERDICT

if TYPE_CHECKING:
    from mobee.pose import Pose


class Actions:
    """`parts` (P, PART), see `layout`, and `tests` (P, 2), their settle tests: what the loop reads and changes."""

    __slots__ = ("_names", "parts", "tests")

    def __init__(self, robot: Robot) -> None:
        self._names = tuple(robot.parts)
        self.parts: Ints = np.array([[p.start, p.start + len(p), 0, 0] for p in robot.parts.values()], dtype=np.int64).reshape(-1, PART)
        self.tests: Array = np.zeros((len(self.parts), 2))

    @property
    def under_way(self) -> tuple[str, ...]:
        """The parts that act, in their order."""
        return tuple(self._names[p] for p in np.flatnonzero(self.parts[:, ACTING]))

    def begin(self, part: str, asked: float, first_look: float) -> None:
        """Start a part's settle test, asked for at a time [s]; it is looked at `first_look` s later first."""
        index = self._names.index(part)
        self.tests[index] = asked, asked + first_look
        self.parts[index, ACTING] = 1

    def end_all(self) -> None:
        """Forget what is under way."""
        self.parts[:, ACTING] = 0

    def outcome(self, part: str, q: Array, sampled: float, pose: Pose) -> Outcome:
        """How a part's last action ended, by the encoders q (n,) rad read at time `sampled` [s]."""
        index = self._names.index(part)
        first, stop, verdict = self.parts[index, [FIRST, STOP, VERDICT]]
        return Outcome(q[first:stop].copy(), bool(verdict == SETTLED), sampled - float(self.tests[index, 0]), touched_by(pose, part))
