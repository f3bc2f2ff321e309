"""The learner, and what it learns before it meets the live robot."""

from __future__ import annotations

from pathlib import Path

from experiments.live_reach.problems import grid_targets
from experiments.live_reach.settings import FAILURES, MARKER, PART, PREDICTOR, STRATEGY, offline_plant, space
from mobee import CuriousAgent
from mobee.learning.learned import load_learned
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.reach import ReachPlant
from mobee.store import TransitionStore

TRANSITIONS = 3000  # curious ones, before the first target (thesis 7.2.2: 2987)


def train(file: Path, seed: int, transitions: int, tries: int) -> None:
    """Learn the transitions, and then the 27 targets, on the offline plant; goes on where an earlier call was broken off."""
    plant = offline_plant(seed)
    with TransitionStore(file, PART) as store:
        agent = CuriousAgent(space(), plant, seed=seed, store=store)
        agent.run(max(0, transitions - agent.transitions))
    reacher = learner(plant, seed, file)
    reacher.learn(grid_targets(), max(0, tries - reacher.tries))


def learner(plant: ReachPlant, seed: int, file: Path) -> ReachAgent:
    """The learner on its record: a new one, or as it was."""
    known = load_learned(file, PART, plant.robot)
    return ReachAgent(
        known.space,
        plant,
        known.model.debiased(),
        marker=MARKER,
        predictor=PREDICTOR,
        strategy=STRATEGY,
        failures=FAILURES,
        seed=seed,
        store=ReachStore(file, PART),
    )
