"""The planner alone, the reach alone, and both, in one case after the other."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.control.ride import place
from experiments.either_alone.cases import Case
from experiments.reaching.arm import MARKER, PART, arm_belief, arm_plant, hands, learned_transitions, reach_agent, touchable_targets
from experiments.reaching.targets import GOOD
from mobee import MotorParameters, OfflinePlant
from mobee.learning.explorers import choose
from mobee.learning.reaching.acting import move
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import RADIUS, reward_of
from mobee.robot.robot import Array

WAYS = ("planner", "reach", "both")
EVERY = 5  # ticks, after which a target has moved on
LIMIT = 10  # actions before a reach, and that
REACHES = {"published": 1, "default": 3}  # a case; the thesis reached once


@dataclass(frozen=True, slots=True)
class Attempt:
    """How it ended.

    `missing`: m from the target's surface to the palm.  `seconds`: of plant time.  `thinking`: s of processor time in which plans
    were made.  `reward`: thesis eq. 8.4, of what the law aims at.
    """

    missing: float
    seconds: float
    thinking: float
    reward: float


def trained(seed: int, transitions: int, tries: int, law: str = "default", free: bool = False) -> ReachAgent:
    """A reach learner that has tried the targets of `touchable_targets`, in an empty world."""
    plant = arm_plant(seed + 500, law=law)
    agent = reach_agent(plant, learned_transitions(plant, seed, transitions, law), seed, law)
    agent.learn(touchable_targets(law, free), tries)
    return agent


def attempt(way: str, agent: ReachAgent, case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> Attempt:
    """From rest in the case's pose: go to the best pre-reach state, or reach from there, or first the one and then the other.

    Who reaches and misses may reach again, as often as REACHES says.
    """
    plant = begun(case, seed, motors, law)
    start = plant.time
    plant.present(case.target)
    plant.every(EVERY, (lambda now: plant.present(case.seen_at(now - start))) if case.to is not None else None)
    worth = partial(_nearness, hands(law)) if way == "planner" else agent.predictor.mean
    course = _Course(plant, agent, worth, case, np.random.default_rng([seed, 88]))
    for _ in range(1 if way == "planner" else REACHES[law]):
        if way != "reach":
            course.go()
        aimed = _missing(plant, case, start) if way == "planner" else plant.reach(PART, MARKER).missing
        missing = aimed if case.target.aim == "surface" else max(aimed - case.target.radius, 0.0)
        if missing <= GOOD:
            break
        course.missed()
    return Attempt(missing, plant.time - start, course.thinking, reward_of(aimed))


def _missing(plant: OfflinePlant, case: Case, start: float) -> float:
    """How far the palm is from where it was to be, now, m."""
    whole = np.concatenate([plant.measure(part) for part in plant.robot.parts])
    return case.seen_at(plant.time - start).missing(plant.model.evaluate(whole).position(MARKER))


def begun(case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> OfflinePlant:
    """The arm at rest where a case begins."""
    plant = arm_plant(seed, case.world(), motors, law)
    place(plant, arm_belief(law=law).whole(case.start))
    return plant


def _nearness(palms: Array, target: Array) -> Array:
    """What being in each state is worth to who cannot reach, (S,): the reward of where the palm is then."""
    distances = np.maximum(np.linalg.norm(palms - target, axis=1) - RADIUS, 0.0)
    return np.array([reward_of(float(distance)) for distance in distances])


class _Course:
    """The way of one case by plans, as in an evaluation (thesis 8.3.3); what failed in it and from where a reach missed is remembered."""

    def __init__(
        self, plant: OfflinePlant, agent: ReachAgent, worth: Callable[[Array], Array], case: Case, rng: np.random.Generator
    ) -> None:
        self._plant, self._agent, self._worth, self._case, self._rng = plant, agent, worth, case, rng
        self._failures, self._begun = agent.failures.copy(), plant.time
        self._state = -1
        self._spent: list[int] = []
        self.thinking = 0.0
        """s of processor time spent on plans."""

    def go(self) -> None:
        """Follow the plan to where ending it is worth most, or until the actions are used up."""
        space = self._agent.space
        self._state = space.state_of(self._plant.measure(PART)[space.columns])
        for _ in range(LIMIT - 1):
            target, asked = self._case.target_at(self._plant.time - self._begun), time.process_time()
            worth = np.maximum(self._worth(target), 0.0)
            worth[self._spent] = 0.0
            values, action_values = self._agent.planning.values(worth, self._failures.rewards(target))
            action = choose(action_values[self._state], self._rng)
            self.thinking += time.process_time() - asked
            if action == space.goals.shape[1]:
                return
            _, following = move(self._plant, space, self._state, action)
            failed = has_failed(values, self._state, following)
            self._failures.add(self._state, action, target, self._agent.penalty if failed else 0.0)
            self._state = following

    def missed(self) -> None:
        """Expect nothing more of reaching from here in this case."""
        self._spent.append(self._state)
