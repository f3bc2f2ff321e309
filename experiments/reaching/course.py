"""The way of one try by plans, as in an evaluation (thesis 8.3.3), on any plant and to any target, also one that moves."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from mobee.learning.explorers import choose
from mobee.learning.reaching.acting import move
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.plant import Plant
from mobee.robot.robot import Array

LIMIT = 10  # actions before a reach, and that


class Course:
    """Goes to where reaching is worth most; what failed in this try and from where a reach missed is remembered, and nothing learned.

    Args:
        plant: what moves.
        agent: whose plans are followed.
        worth: of reaching for a target (3,) m from each state, (S,).
        where: is the target now, (3,) m.
        rng: of draws among equals.
        apart: of the motors' ranges, all together: states no farther than this from one that missed are not expected to do better.
    """

    def __init__(
        self,
        plant: Plant,
        agent: ReachAgent,
        worth: Callable[[Array], Array],
        where: Callable[[], Array],
        rng: np.random.Generator,
        apart: float = 0.0,
    ) -> None:
        self._plant, self._agent, self._worth, self._where, self._rng = plant, agent, worth, where, rng
        self._failures = agent.failures.copy()
        self._state = -1
        self._spent = np.zeros(len(agent.space), dtype=bool)
        self._apart = apart
        self.actions = 0
        """Transitions made."""
        self.thinking = 0.0
        """s of processor time spent on plans."""

    def go(self) -> None:
        """Follow the plan to where ending it is worth most, or until the actions are used up."""
        space = self._agent.space
        self._state = space.state_of(self._plant.measure(space.part)[space.columns])
        for _ in range(LIMIT - 1):
            target, asked = self._where(), time.process_time()
            worth = np.maximum(self._worth(target), 0.0)
            worth[self._spent] = 0.0
            values, action_values = self._agent.planning.values(worth, self._failures.rewards(target))
            action = choose(action_values[self._state], self._rng)
            self.thinking += time.process_time() - asked
            if action == space.goals.shape[1]:
                return
            self.actions += 1
            _, following = move(self._plant, space, self._state, action)
            failed = has_failed(values, self._state, following)
            self._failures.add(self._state, action, target, self._agent.penalty if failed else 0.0)
            self._state = following

    def missed(self) -> None:
        """Expect nothing more of reaching from here in this try."""
        space = self._agent.space
        spans = np.ptp(space.robot.limits[space.robot.part(space.part).slice][space.columns], axis=1)
        ways = np.abs(space.samples - space.samples[self._state]) / spans
        self._spent |= ways.sum(axis=1) <= self._apart + 1e-9
