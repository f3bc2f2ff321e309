# SPDX-License-Identifier: Apache-2.0
"""A tabular plant with reaches, for tests and for worlds with known ground truth."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.explorers import Draws
from mobee.learning.space import Space
from mobee.learning.tabular import TabularPlant
from mobee.plant import Outcome
from mobee.reach import TARGET, ReachOutcome, ReachTarget

World = Callable[[Array], tuple[Array, Array]]


class ReachTable(TabularPlant):
    """A TabularPlant on which a part can reach, and the presented target may block transitions.

    The random outcome of the n-th action depends on the seed and n alone.

    Args:
        space, outcomes, probabilities, seed, start: of the TabularPlant.
        world: function of a target (3,) m that returns the mean remaining error of a reach from each state, (S,) m, and the probability
            that the target blocks each transition, (S, A); a blocked one
            ends in the state where it began.  Called once for each position.
        noise: m, standard deviation of the remaining error.
    """

    def __init__(
        self,
        space: Space,
        outcomes: ArrayLike,
        probabilities: ArrayLike,
        world: World,
        noise: float = 0.0,
        seed: int = 0,
        start: int = 0,
    ) -> None:
        super().__init__(space, outcomes, probabilities, seed, start)
        self._world, self._noise = world, noise
        self._seen: dict[bytes, tuple[Array, Array]] = {}
        self._presented: tuple[Array, Array] | None = None
        self._chances = Draws("reach table")

    @property
    def settings(self) -> dict[str, Any]:
        """A hash of the table of transitions, and the noise, as plain JSON values; they do not cover the function `world`."""
        return super().settings | {"noise": self._noise}

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world; None removes it."""
        if target is None:
            self._presented = None
            return
        key = target.position.tobytes()
        if key not in self._seen:
            self._seen[key] = self._world(target.position)
        self._presented = self._seen[key]

    def act(self, part: str, target: Array) -> Outcome:
        """Act as the TabularPlant does, unless the presented target blocks the transition; each takes 1 s."""
        if self._presented is not None:
            action = self._action[self.state].get(self.space.state_of(target))
            if action is not None and self._chance() < self._presented[1].item(self.state, action):
                self.actions += 1
                return Outcome(self.measure(part), settled=True, duration=1.0, touched=(TARGET,))
        return super().act(part, target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach with the remaining error of the table and return to the start; takes 2 s.  The marker's position is always 0."""
        if self._presented is None:
            raise InvalidValue(f"nothing to reach for with the {marker}: present a target first.")
        q = self.measure(part)
        missing = self._presented[0].item(self.state)
        if self._noise:
            missing = abs(missing + self._noise * float(self._chances.at(self.seed, self.actions).standard_normal()))
        self.actions += 1
        after = Outcome(q, settled=True, duration=1.0)
        return ReachOutcome(np.zeros(3), q, missing, settled=True, duration=2.0, touched=(), after=after)

    def _chance(self) -> float:
        return float(self._chances.at(self.seed, self.actions).random())
