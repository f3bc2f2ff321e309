# SPDX-License-Identifier: Apache-2.0
"""True outcomes of the actions of a plant, measured by many tries, and errors of transition models with respect to them.

The outcome of an action depends on where in the cell of its first state the part is, and on the momentum that it still has.  Therefore the
tries are made on a walk through the states, in which each action starts where the last one ended, as for an agent.  Half of the steps are
to a random neighbour, half are planned towards actions that need more tries.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.kit.learning.exploration import begin_nearby
from mobee import Plant, TransitionModel, value_iteration
from mobee.arrays import Array, Ints
from mobee.learning.explorers import choose
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel

ANYWHERE = 0.5  # share of a walk's steps that go to a random neighbour
DISCOUNT, TOLERANCE = 0.9, 0.01
CERTAIN = 0.9  # probability of the most likely outcome, below which an action is stochastic


@dataclass(frozen=True, eq=False)
class Truth:
    """Measured frequencies of the outcomes of each state-action; a `mobee.learning.value_iteration.OutcomeModel`.

    `outcomes`: (S, A, B), the states reached, up to B for each state-action.  `probabilities`: (S, A, B), their frequencies; 0 in unused
    entries, and where there is no action or no try.  `tries`: (S, A), number of tries.
    """

    outcomes: Ints
    probabilities: Array
    tries: Ints


def truth_of(space: Space, seen: Ints) -> Truth:
    """Return the frequencies of the outcomes in transitions `seen` (T, 3), rows of state, action, state reached."""
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
    return Truth(outcomes.reshape(shape), probabilities.reshape(shape), tries.reshape(states, actions).astype(np.intp))


def walk(space: Space, plant_of: Callable[[int], Plant], tries: int, most: int, seed: int) -> Ints:
    """Walk through the states until every action was tried `tries` times; returns the transitions (T, 3): state, action, state reached.

    `plant_of`: function that returns a new plant for a seed.  `most`: largest number of transitions, after which the walk ends in any case.
    `seed`: seed of the plant and of the random actions.
    """
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
        reached = space.state_of(outcome.q)
        model.observe(state, action, reached)
        lacking[state, action] = max(0.0, 1.0 - model.tries[state, action] / tries)
        seen.append((state, action, reached))
        state = reached
    return np.array(seen, dtype=np.intp).reshape(-1, 3)


def l1(beliefs: OutcomeModel, truth: OutcomeModel) -> Array:
    """Return the L1 error of a transition model, the sum of |p - q| over the outcomes of each state-action, (S, A), 0 to 2.

    `beliefs`: the model.  `truth`: the true outcomes.  The error is NaN for a state-action that does not exist or was never tried.  The
    outcomes of the two models may differ in order and number, and several outcomes of a model may stand for the same state: their
    probabilities are added.
    """
    states, actions = truth.outcomes.shape[:2]
    pair = np.arange(states * actions)[:, None]
    keys, signed = [], []
    for model, sign in ((beliefs, 1.0), (truth, -1.0)):
        probabilities = model.probabilities.reshape(states * actions, -1)
        keys.append((pair * states + model.outcomes.reshape(probabilities.shape))[probabilities > 0.0])
        signed.append(sign * probabilities[probabilities > 0.0])
    found, index = np.unique(np.concatenate(keys), return_inverse=True)
    difference = np.abs(np.bincount(index, weights=np.concatenate(signed)))
    error = np.bincount(found // states, weights=difference, minlength=states * actions).reshape(states, actions)
    return np.where(truth.probabilities.any(axis=-1), error, np.nan)


def most_likely(truth: OutcomeModel) -> Array:
    """Return the probability of the most likely outcome of each state-action, (S, A); NaN without an action or a try."""
    highest: Array = truth.probabilities.max(axis=-1)
    return np.where(highest > 0.0, highest, np.nan)


def model_error(beliefs: OutcomeModel, truth: OutcomeModel) -> tuple[float, float]:
    """Return the mean L1 error of a transition model over all state-actions, and over the stochastic ones only (NaN if there are none).

    `beliefs`: the model.  `truth`: the true outcomes.  A state-action is stochastic if its most likely outcome has a probability below 0.9.
    """
    error = l1(beliefs, truth)
    stochastic = most_likely(truth) < CERTAIN
    return float(np.nanmean(error)), float(error[stochastic].mean()) if stochastic.any() else float("nan")


def sampling_error(truth: Truth) -> Array:
    """Return the expected L1 distance between the measured frequencies and the true distribution, (S, A); NaN without tries.

    It is the sum of sqrt(2 p (1 - p) / (pi n)) over the outcomes: the mean absolute error of a frequency p that was measured in n tries.
    An error of a model that is smaller than this distance cannot be measured.
    """
    p = truth.probabilities
    with np.errstate(invalid="ignore", divide="ignore"):
        error: Array = np.sqrt(2.0 * p * (1.0 - p) / (np.pi * truth.tries[..., None])).sum(axis=-1)
    return error
