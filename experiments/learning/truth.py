"""Where the actions of a plant really lead, by many tries of each: what learnt transition models are compared with.

Where an action ends depends on where in its cell, and with what momentum, the part arrived.  So the tries are those of a walk
through the states, which begins each action where the last one ended, as an agent does: half of its steps go anywhere, half
towards actions that lack tries.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from experiments.learning.trial import begin_nearby
from mobee import Plant, TransitionModel, run_batch, value_iteration
from mobee.errors import InvalidValue
from mobee.learning.explorers import choose
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.robot.robot import Array, Ints

ANYWHERE = 0.5  # share of a walk's steps that go to a random neighbour
DISCOUNT, TOLERANCE = 0.9, 0.01


@dataclass(frozen=True, eq=False)
class Truth:
    """How often each action ended where, as an OutcomeModel.

    `outcomes`, `probabilities`: (S, A, B); no probability where there is no action or no try.  `tries`: (S, A).
    `settings`: of the space.
    """

    outcomes: Ints
    probabilities: Array
    tries: Ints
    settings: dict[str, Any]

    def save(self, path: Path) -> None:
        """Write it as .npz."""
        np.savez_compressed(
            path, outcomes=self.outcomes, probabilities=self.probabilities, tries=self.tries, settings=json.dumps(self.settings)
        )


def load_truth(path: Path, space: Space) -> Truth:
    """The truth in a file; raises InvalidValue if it is about another space."""
    with np.load(path) as file:
        truth = Truth(file["outcomes"], file["probabilities"], file["tries"], json.loads(str(file["settings"])))
    if truth.settings["digest"] != space.settings["digest"]:
        raise InvalidValue(f"{path} is about another space, {truth.settings}: measure the truth of this one, {space.settings}.")
    return truth


def truth_of(space: Space, seen: Ints) -> Truth:
    """The frequencies in what was seen, shape (T, 3): state, action, state reached."""
    states, actions = space.goals.shape
    keys, counts = np.unique(np.ravel_multi_index(tuple(seen.T), (states, actions, states)), return_counts=True)
    pair, reached = np.divmod(keys, states)
    first = np.searchsorted(pair, pair)  # of the outcomes of the same state-action
    bin_ = np.arange(len(pair)) - first
    outcomes = np.zeros((states * actions, max(bin_, default=0) + 1), dtype=np.intp)
    counted = np.zeros(outcomes.shape)
    outcomes[pair, bin_], counted[pair, bin_] = reached, counts
    tries = counted.sum(axis=1, keepdims=True)
    shape = (states, actions, -1)
    probabilities = counted / np.maximum(tries, 1.0)
    return Truth(
        outcomes.reshape(shape), probabilities.reshape(shape), tries.reshape(states, actions).astype(np.intp), dict(space.settings)
    )


def measure_truth(
    space: Space, plant_of: Callable[[int], Plant], tries: int, seeds: Iterable[int], most: int, processes: int | None = None
) -> Truth:
    """Let one walk a seed try every action that often, all walks at once, and join what they saw.

    Args:
        space: states and actions.
        plant_of: a function of a module that makes a plant of a seed.
        tries: of each action in each walk.
        seeds: of walks and plants.
        most: actions of a walk, should it not get everywhere.
        processes: None: one a core.
    """
    seen = run_batch(partial(walk, space, plant_of, tries, most), seeds, processes)
    return truth_of(space, np.concatenate(seen))


def walk(space: Space, plant_of: Callable[[int], Plant], tries: int, most: int, seed: int) -> Ints:
    """What a walk saw until it had tried every action that often, shape (T, 3): state, action, state reached."""
    plant, rng = plant_of(seed), np.random.default_rng(seed)
    model, values = TransitionModel(space), np.zeros(len(space))
    state = begin_nearby(space, plant, seed)
    lacking = np.where(space.goals == NO_ACTION, 0.0, 1.0)
    seen: list[tuple[int, int, int]] = []
    while lacking.any() and len(seen) < most:
        if rng.random() < ANYWHERE:
            action = int(rng.integers(len(space.actions(state))))
        else:
            values, found = value_iteration(model.debiased(), lacking, DISCOUNT, TOLERANCE, values)
            action = choose(found[state], rng)
        outcome = plant.act(space.part, space.target(space.goal(state, action)))
        reached = space.state_of(outcome.q[space.columns])
        model.observe(state, action, reached)
        lacking[state, action] = max(0.0, 1.0 - model.tries[state, action] / tries)
        seen.append((state, action, reached))
        state = reached
    return np.array(seen, dtype=np.intp).reshape(-1, 3)
