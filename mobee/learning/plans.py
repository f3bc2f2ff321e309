"""The plans of an agent: each starts from the values of the one before, and what was planned follows from the transitions alone."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mobee.errors import InvalidValue
from mobee.learning.value_iteration import OutcomeModel, value_iteration
from mobee.robot.robot import Array


class _Made(NamedTuple):
    """A plan, and for what it was asked."""

    reward: Array | None
    beliefs: OutcomeModel | None
    plan: tuple[Array, Array]


class Plans:
    """Plans by key: made once a transition, forgotten with it when it is interrupted, kept as next start when it is observed.

    `relative`: with a tolerance in units of the largest reward and warm starts; else Algorithm 7 as published, with an
    absolute tolerance and every value zero at the start.  Raises InvalidValue for a discount or tolerance out of range.
    """

    def __init__(self, discount: float, tolerance: float, relative: bool) -> None:
        if not (0.0 <= discount < 1.0 and 0.0 < tolerance < np.inf):
            raise InvalidValue(f"discount={discount!r}, tolerance={tolerance!r}: valid are 0 <= discount < 1 and a tolerance above 0.")
        self.discount, self.tolerance, self.relative = discount, tolerance, relative
        self._starts: dict[str, Array] = {}
        self._made: dict[str, _Made] = {}

    def made(self, key: str, reward: Array | None, beliefs: OutcomeModel | None) -> tuple[Array, Array] | None:
        """The plan of a key made since the last transition, if it was asked for with the same objects."""
        made = self._made.get(key)
        return made.plan if made is not None and made.reward is reward and made.beliefs is beliefs else None

    def make(
        self, key: str, asked: Array | None, believed: OutcomeModel | None, reward: Array, beliefs: OutcomeModel
    ) -> tuple[Array, Array]:
        """Plan for a reward (S, A) with beliefs, and remember it under what it was asked for."""
        if self.relative:
            before = self._made.get(key)
            start = self._starts.get(key) if before is None else before.plan[0]
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance, start, relative=True, method="modified")
        else:
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance)
        for values in plan:
            values.setflags(write=False)
        self._made[key] = _Made(asked, believed, plan)
        return plan

    def keep(self) -> None:
        """A transition was observed: what was planned before it is where the next plans start."""
        for key, made in self._made.items():
            self._starts[key] = made.plan[0]
        self._made.clear()

    def undo(self) -> None:
        """The action was interrupted: nothing was planned."""
        self._made.clear()
