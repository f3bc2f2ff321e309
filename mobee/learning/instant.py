# SPDX-License-Identifier: Apache-2.0
"""Plants of one part that perform an action at once, without a simulation of the motion."""

from __future__ import annotations

from abc import ABC, abstractmethod

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.space import Space
from mobee.plant import Outcome


class InstantPlant(ABC):
    """A plant of one part that simulates no motion: an action ends in the call of `act`, and counts as 1 s.

    `begin` only stores the target; `advance` then calls `act`. So `mobee.learning.agent.run` can use the plant too.
    """

    def __init__(self, space: Space) -> None:
        self.space: Space = space
        """The states and actions of the part."""
        self.robot = space.robot
        self._under_way: Array | None = None

    @abstractmethod
    def act(self, part: str, target: Array) -> Outcome:
        """Perform an action and return its outcome; the action counts as 1 s.

        `part`: must be `space.part`, where `space` is the plant's state space. `target`: (n_part,), as the method `space.aim` returns it
        for a state and an action.
        """

    def begin(self, part: str, target: Array) -> None:
        """Store the target of an action; `advance` performs the action. Raises InvalidValue if an action is under way.

        `part`: must be `space.part`, else UnknownName is raised. `target`: as in `act`.
        """
        self._check_part(part)
        if self._under_way is not None:
            raise InvalidValue(f"{part} has an action under way: wait for it with advance().")
        self._under_way = target

    def advance(self) -> list[tuple[str, Outcome]]:
        """Perform the action that was begun; return a list with its part and outcome. Raises InvalidValue if none was begun."""
        if self._under_way is None:
            raise InvalidValue("no action is under way: begin one first.")
        target, self._under_way = self._under_way, None
        return [(self.space.part, self.act(self.space.part, target))]

    def _check_part(self, part: str) -> None:
        if part != self.space.part:
            raise UnknownName("part", part, (self.space.part,))
