"""Plants on which contact tells nothing: everything is the model's fault, or every failure is the target's."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from mobee.learning.space import Space
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachPlant, ReachTarget
from mobee.robot.robot import Array

Blame = Literal["model", "target"]
BLAMES: tuple[Blame, ...] = ("model", "target")


class BlamingPlant:
    """Acts as the plant does, and reports other contacts of transitions: none, or the target's wherever one ends beside its goal.

    Args:
        plant: on which it acts.
        space: its states and transitions.
        blame: "model" or "target".
    """

    def __init__(self, plant: ReachPlant, space: Space, blame: Blame) -> None:
        self.inner, self.robot, self._space, self._blame = plant, plant.robot, space, blame

    def measure(self, part: str) -> Array:
        """See Plant."""
        return self.inner.measure(part)

    def act(self, part: str, target: Array) -> Outcome:
        """See Plant; with the contacts that it makes up."""
        outcome = self.inner.act(part, target)
        arrived = self._state(outcome.q) == self._state(target)
        return replace(outcome, touched=() if self._blame == "model" or arrived else (TARGET,))

    def present(self, target: ReachTarget | None) -> None:
        """See ReachPlant."""
        self.inner.present(target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """See ReachPlant."""
        return self.inner.reach(part, marker, stay)

    def _state(self, q: Array) -> int:
        return self._space.state_of(q[self._space.columns])
