"""The planner alone, the reach alone, and both, in one case after the other."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.either_alone.cases import Case
from experiments.kit.control_runs import place
from experiments.reaching.arm import MARKER, PART, arm_belief, arm_plant, hands, learned_transitions, reach_agent, touchable_targets
from experiments.reaching.course import Course
from experiments.reaching.targets import GOOD
from mobee import MotorParameters, OfflinePlant
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import RADIUS, reward_of
from mobee.robot.robot import Array

WAYS = ("planner", "reach", "both")
EVERY = 5  # ticks, after which a target has moved on
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
    course = Course(plant, agent, worth, lambda: case.target_at(plant.time - start), np.random.default_rng([seed, 88]))
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
