"""The planner alone, the reach alone, and both, in one case after the other."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from experiments.control.ride import place
from experiments.either_alone.cases import Case
from experiments.reaching.arm import MARKER, PART, arm_belief, arm_plant, hands, learned_transitions, reach_agent, reachable
from mobee import MotorParameters, OfflinePlant
from mobee.learning.explorers import choose
from mobee.learning.reaching.acting import move
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import RADIUS, reward_of
from mobee.robot.robot import Array

WAYS = ("planner", "reach", "both")
EVERY = 5  # ticks, after which a target has moved on
LIMIT = 10  # actions


@dataclass(frozen=True, slots=True)
class Attempt:
    """How it ended.

    `missing`: m from the target's surface to the palm.  `seconds`: of plant time.  `thinking`: s of this machine's time in which plans
    were made.  `reward`: thesis eq. 8.4, of what the law aims at.
    """

    missing: float
    seconds: float
    thinking: float
    reward: float


def trained(seed: int, transitions: int, tries: int, law: str = "default") -> ReachAgent:
    """A reach learner that has tried the targets, in an empty world."""
    plant = arm_plant(seed + 500, law=law)
    agent = reach_agent(plant, learned_transitions(plant, seed, transitions, law), seed, law)
    agent.learn(reachable(law, free=False), tries)
    return agent


def attempt(way: str, agent: ReachAgent, case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> Attempt:
    """From rest in the case's pose: go to the best pre-reach state, or reach from there, or first the one and then the other."""
    plant = begun(case, seed, motors, law)
    start, thinking = plant.time, 0.0
    plant.present(case.target)
    plant.every(EVERY, (lambda now: plant.present(case.seen_at(now - start))) if case.to is not None else None)
    if way != "reach":
        rng = np.random.default_rng([seed, 88])
        worth = agent.predictor.mean if way == "both" else partial(_nearness, hands(law))
        thinking = _go(plant, agent, worth, case, start, rng)
    if way == "planner":
        whole = np.concatenate([plant.measure(part) for part in plant.robot.parts])
        aimed = case.seen_at(plant.time - start).missing(plant.model.evaluate(whole).position(MARKER))
    else:
        aimed = plant.reach(PART, MARKER).missing
    missing = aimed if case.target.aim == "surface" else max(aimed - case.target.radius, 0.0)
    return Attempt(missing, plant.time - start, thinking, reward_of(aimed))


def begun(case: Case, seed: int, motors: MotorParameters | None = None, law: str = "default") -> OfflinePlant:
    """The arm at rest where a case begins."""
    plant = arm_plant(seed, case.world(), motors, law)
    place(plant, arm_belief(law=law).whole(case.start))
    return plant


def _nearness(palms: Array, target: Array) -> Array:
    """What being in each state is worth to who cannot reach, (S,): the reward of where the palm is then."""
    distances = np.maximum(np.linalg.norm(palms - target, axis=1) - RADIUS, 0.0)
    return np.array([reward_of(float(distance)) for distance in distances])


def _go(
    plant: OfflinePlant, agent: ReachAgent, worth: Callable[[Array], Array], case: Case, start: float, rng: np.random.Generator
) -> float:
    """Follow the plan to where ending it is worth most, as an evaluation does: failures are remembered meanwhile (thesis 8.1, 8.3.3).

    Returns s of this machine's time spent on plans.
    """
    failures, columns, thinking = agent.failures.copy(), agent.space.columns, 0.0
    state = agent.space.state_of(plant.measure(PART)[columns])
    for _ in range(LIMIT - 1):
        target, asked = case.target_at(plant.time - start), time.perf_counter()
        values, action_values = agent.planning.values(np.maximum(worth(target), 0.0), failures.rewards(target))
        action = choose(action_values[state], rng)
        thinking += time.perf_counter() - asked
        if action == agent.space.goals.shape[1]:
            break
        _, following = move(plant, agent.space, state, action)
        failures.add(state, action, target, agent.penalty if values[following] <= values[state] else 0.0)
        state = following
    return thinking
