"""Who reaches: the learner and the planner peers, which meet the same targets under the same rules."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from experiments.kit.reaching.arm import PART, learned_transitions, reach_agent, space
from experiments.kit.reaching.planner_peer import ENDS, Memory, PeerTry, PlannerPeer
from experiments.kit.reaching.targets import GOOD
from experiments.unmodelled.scene import Scene
from mobee.learning.reaching.problems import Problems
from mobee.reach import ReachTarget
from mobee.robot.robot import Array

FATES = ("reached", "missed", "used up", "no plan")
"""How a try ends: within 2 cm of the target; not, though it went as planned; not before the actions were used up; with no way known."""


@dataclass(frozen=True, slots=True, eq=False)
class Score:
    """Of evaluation tries: the share of each of FATES (4,), and the mean plant time [s] and actions of a try."""

    fates: Array
    seconds: float
    actions: float

    def values(self) -> dict[str, Any]:
        """As the values of a cell."""
        return {"fates": self.fates.tolist(), "seconds": self.seconds, "actions": self.actions}


class Contestant(Protocol):
    """Makes tries, and is evaluated without a trace."""

    def learn(self, tries: int) -> None:
        """Make that many more tries, each of the target least tried (thesis 8.3.2)."""

    def evaluate(self, repetitions: int) -> Score:
        """From random states reach for all targets in random order, that often (thesis 8.3.3)."""

    @property
    def hours(self) -> float:
        """Of plant time so far, what was learned before the first try included, evaluations not."""


class Learner:
    """The reach learner; its transitions are learned before, in the same workspace without the unseen ball."""

    def __init__(self, scene: Scene, seed: int) -> None:
        alone = scene.plant(seed + 500, ball=False)
        model = learned_transitions(alone.inner, seed)
        self._plant, self._targets = scene.plant(seed), scene.targets
        self.agent = reach_agent(self._plant, model, seed)
        self._seconds = alone.time

    def learn(self, tries: int) -> None:
        """See Contestant."""
        before = self._plant.time
        self.agent.learn(self._targets, tries)
        self._seconds += self._plant.time - before

    def evaluate(self, repetitions: int) -> Score:
        """See Contestant."""
        found = self.agent.evaluate(self._targets, repetitions)
        arrived = np.isfinite(found.missing)
        good = np.where(arrived, found.missing, np.inf) <= GOOD
        fates = np.array([good.mean(), (arrived & ~good).mean(), (~arrived).mean(), 0.0])
        return Score(fates, float(found.duration.mean()), float(found.actions.mean()))

    @property
    def hours(self) -> float:
        """See Contestant."""
        return self._seconds / 3600.0


class Planner:
    """The peer: it plans, and learns no more than its memory."""

    def __init__(self, scene: Scene, memory: Memory, seed: int) -> None:
        self._scene, self._seed, self._tries, self._seconds = scene, seed, 0, 0.0
        self._plant = scene.plant(seed)
        self.peer = PlannerPeer(self._plant, scene.belief(), PART, memory, seed)
        self._problems = Problems()
        self.planning: list[float] = []
        """Of all tries so far, s of processor time."""

    def learn(self, tries: int) -> None:
        """See Contestant."""
        for _ in range(tries):
            rng = np.random.default_rng([self._seed, 861, self._tries])
            target = self._problems.least_tried(self._scene.targets, rng)
            number = self._problems.index(target)
            self._seconds += self._try(target).seconds
            self._problems.tries[number] += 1
            self._tries += 1

    def evaluate(self, repetitions: int) -> Score:
        """See Contestant; what it remembers of a repetition it keeps to the end of that."""
        tries: list[PeerTry] = []
        known = self.peer.knowledge()
        for repetition in range(repetitions):
            rng = np.random.default_rng([self._seed, 862, self._tries, repetition])
            self._plant.present(None)
            self._plant.act(PART, space().target(int(rng.integers(len(space())))))
            tries += [self._try(self._scene.targets[i]) for i in rng.permutation(len(self._scene.targets))]
            self.peer.restore(known)
        return _score(tries)

    @property
    def hours(self) -> float:
        """See Contestant."""
        return self._seconds / 3600.0

    def _try(self, target: ReachTarget) -> PeerTry:
        tried = self.peer.try_problem(target, lambda: self._scene.seen(target))
        self.planning.append(tried.planning)
        return tried


def _score(tries: Sequence[PeerTry]) -> Score:
    good = np.array([one.missing <= GOOD for one in tries])
    ended = [np.array([one.ended == end for one in tries]) & ~good for end in ENDS]
    fates = np.array([good.mean(), *(one.mean() for one in ended)])
    return Score(fates, float(np.mean([one.seconds for one in tries])), float(np.mean([one.actions for one in tries])))
