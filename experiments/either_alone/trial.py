"""The planner alone, the reach alone, and both, in one case after the other."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.control.ride import place
from experiments.either_alone.cases import Case
from experiments.reaching.arm import MARKER, PART, arm_belief, arm_plant, hands, learned_transitions, reach_agent, reachable, space
from mobee import OfflinePlant
from mobee.learning.explorers import choose
from mobee.learning.reaching.acting import move
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.reach import ReachTarget, reward_of
from mobee.robot.robot import Array

WAYS = ("planner", "reach", "both")
EVERY = 5  # ticks, after which a target has moved on
LIMIT = 10  # actions


@dataclass(frozen=True, slots=True)
class Attempt:
    """What the palm missed in the end [m], and s of plant time."""

    missing: float
    seconds: float


def trained(seed: int, transitions: int, tries: int) -> ReachAgent:
    """A reach learner that has tried the reachable ones of the 27 targets, in an empty world."""
    plant = arm_plant(seed + 500)
    agent = reach_agent(plant, learned_transitions(plant, seed, transitions), seed)
    agent.learn(reachable(), tries)
    return agent


def attempt(way: str, agent: ReachAgent, case: Case, seed: int) -> Attempt:
    """From rest in the case's pose: go to the best pre-reach state, or reach from there, or first the one and then the other."""
    plant = arm_plant(seed, case.world())
    place(plant, arm_belief().whole(case.start))
    begun = plant.time

    def present(now: float) -> None:
        plant.present(ReachTarget(case.target_at(now - begun), case.target.radius, "surface"))

    present(begun)
    plant.every(EVERY, present if case.to is not None else None)
    if way != "reach":
        rng = np.random.default_rng([seed, 88])
        _go(plant, agent, (lambda target: agent.predictor.mean(target)) if way == "both" else _nearness, case, begun, rng)
    if way == "planner":
        q = np.concatenate([plant.measure(part) for part in plant.robot.parts])
        target = ReachTarget(case.target_at(plant.time - begun), case.target.radius, "surface")
        return Attempt(target.missing(plant.model.evaluate(q).position(MARKER)), plant.time - begun)
    outcome = plant.reach(PART, MARKER)
    return Attempt(outcome.missing, plant.time - begun)


def _nearness(target: Array) -> Array:
    """What being in each state is worth to who cannot reach, (S,): the reward of where the palm is then."""
    distances = np.maximum(np.linalg.norm(hands() - target, axis=1) - ReachTarget(target).radius, 0.0)
    return np.array([reward_of(float(distance)) for distance in distances])


def _go(
    plant: OfflinePlant, agent: ReachAgent, worth: Callable[[Array], Array], case: Case, begun: float, rng: np.random.Generator
) -> None:
    """Follow the plan to where ending it is worth most, as an evaluation does: failures are remembered meanwhile (thesis 8.1, 8.3.3)."""
    failures, columns = agent.failures.copy(), space().columns
    state = space().state_of(plant.measure(PART)[columns])
    for _ in range(LIMIT - 1):
        target = case.target_at(plant.time - begun)
        values, action_values = agent.planning.values(np.maximum(worth(target), 0.0), failures.rewards(target))
        action = choose(action_values[state], rng)
        if action == space().goals.shape[1]:
            return
        _, following = move(plant, space(), state, action)
        failures.add(state, action, target, agent.penalty if values[following] <= values[state] else 0.0)
        state = following
