"""The problems of a reach learner: one for every place that it was asked to reach for (thesis 8.0, 8.3.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from mobee.errors import InvalidValue
from mobee.reach import ReachTarget


class Problems:
    """Targets by number, in the order in which they were first met, and how often each was tried."""

    def __init__(self) -> None:
        self.targets: list[ReachTarget] = []
        """The target of each problem, as it was first met."""
        self.tries: list[int] = []
        """How many problem-tries of each have ended."""
        self._known: dict[bytes, int] = {}

    def __len__(self) -> int:
        return len(self.targets)

    def index(self, target: ReachTarget) -> int:
        """The number of the problem at the target's place; a new place is a new problem."""
        number = self._known.setdefault(place(target), len(self.targets))
        if number == len(self.targets):
            self.targets.append(target)
            self.tries.append(0)
        return number

    def least_tried(self, targets: Sequence[ReachTarget], rng: np.random.Generator) -> ReachTarget:
        """The target tried least often, drawn among equals (thesis 8.3.2); raises InvalidValue if there is none."""
        if not targets:
            raise InvalidValue("there are no problems to choose from: give at least one target.")
        tries = [self.tries[n] if (n := self._known.get(place(target))) is not None else 0 for target in targets]
        least = min(tries)
        equal = [target for target, count in zip(targets, tries, strict=True) if count == least]
        return equal[int(rng.integers(len(equal)))]


def place(target: ReachTarget) -> bytes:
    """What tells one problem from another: where it is."""
    return (target.position + 0.0).tobytes()  # -0 and 0 are one place
