# SPDX-License-Identifier: Apache-2.0
"""A plant given by tables that can also reach (move its marker to a target), for tests and for worlds with known ground truth."""

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
    """A `TabularPlant` that can also reach for a target. The target given to `present` may block transitions.

    The random numbers of the n-th action or reach depend only on the seed and n. In shapes, S is the number of states, A the largest number
    of actions of a state, and B the largest number of outcomes of an action.

    Args:
        space: the states and transitions.
        outcomes: (S, A, B) the states in which each transition may end.
        probabilities: (S, A, B) the probabilities of the outcomes, if no target blocks the transition.
        world: a function of a target's position (3,) m, called once for each position. It returns the mean remaining distance [m] of a
            reach from each state, (S,), and the probability that the target blocks each transition, (S, A). A blocked transition ends in
            its start state.
        noise: standard deviation of the remaining distance, m.
        seed: seed of all random outcomes.
        start: the first state.
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
        """A hash of the tables of transitions, and the noise, as JSON values; the function `world` is not part of them."""
        return super().settings | {"noise": self._noise}

    def present(self, target: ReachTarget | None) -> None:
        """Put the target into the world, in place of the previous one; None: remove it."""
        if target is None:
            self._presented = None
            return
        key = target.position.tobytes()
        if key not in self._seen:
            self._seen[key] = self._world(target.position)
        self._presented = self._seen[key]

    def act(self, part: str, target: Array) -> Outcome:
        """Perform the action of the present state whose goal has the pose `target`, (n_part,) rad; the outcome's duration is 1 s.

        If the reach target (given to `present`) blocks the action, the part stays in its state and touches the reach target. Raises
        InvalidValue if the state has no such action. `part`: must be the part of the space.
        """
        if self._presented is not None:
            action = self._action[self.state].get(self.space.state_of(target))
            if action is not None and self._chance() < self._presented[1].item(self.state, action):
                self.actions += 1
                return Outcome(self.measure(part), settled=True, duration=1.0, touched=(TARGET,))
        return super().act(part, target)

    def reach(self, part: str, marker: str, stay: bool = False) -> ReachOutcome:
        """Reach for the target that was given to `present`, from the present state; the part stays in this state.

        The remaining distance in the outcome is |d + e|: d is the mean distance that the function `world` gives for target and state, and e
        is normal noise. The position of the marker in the outcome is always (0, 0, 0), and its duration 2 s. `part`: the part of the space.
        `marker`: name of the marker, only for the error message. `stay`: not used. Raises InvalidValue if no target is presented, and
        UnknownName for another part.
        """
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
