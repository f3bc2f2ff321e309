# SPDX-License-Identifier: Apache-2.0
"""Plants of one part whose actions end at once."""

from __future__ import annotations

from abc import ABC, abstractmethod

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.space import Space
from mobee.plant import Outcome


class InstantPlant(ABC):
    """A plant of one part whose actions end at once: `advance` calls `act` with the target that `begin` was given."""

    def __init__(self, space: Space) -> None:
        self.space: Space = space
        """The states and actions."""
        self.robot = space.robot
        self._under_way: Array | None = None

    @abstractmethod
    def act(self, part: str, target: Array) -> Outcome:
        """Do the action of a target that `space.aim` returned; it takes 1 s."""

    def begin(self, part: str, target: Array) -> None:
        """Start the action of a target that `space.aim` returned; `advance` ends it."""
        self._check_part(part)
        if self._under_way is not None:
            raise InvalidValue(f"{part} has an action under way: wait for it with advance().")
        self._under_way = target

    def advance(self) -> list[tuple[str, Outcome]]:
        """End the action under way."""
        if self._under_way is None:
            raise InvalidValue("no action is under way: begin one first.")
        target, self._under_way = self._under_way, None
        return [(self.space.part, self.act(self.space.part, target))]

    def _check_part(self, part: str) -> None:
        if part != self.space.part:
            raise UnknownName("part", part, (self.space.part,))
