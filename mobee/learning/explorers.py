# SPDX-License-Identifier: Apache-2.0
"""Explorers, which score the actions of a state: curiosity, the baselines of the thesis, and baselines from the literature."""

from __future__ import annotations

import hashlib
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, lru_cache
from types import ModuleType
from typing import Any, Protocol

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.learning.transitions import DIVERGENCES, TransitionModel
from mobee.learning.value_iteration import OutcomeModel


class Explorable(Protocol):
    """The attributes of an agent that an explorer may read.

    `model`: its transition model. `beliefs`: the outcome model with which it plans. `discount`: factor of future rewards. `seed`: of random
    choices. `part`: name of its part. `transitions`: number of transitions observed so far.
    """

    model: TransitionModel
    beliefs: OutcomeModel
    discount: float
    seed: int
    part: str
    transitions: int

    def plan(self, reward: Array | None = None, beliefs: OutcomeModel | None = None, key: str = "curious") -> tuple[Array, Array]:
        """Compute the values of states (S,) and of actions (S, A) in a plan with the agent's discount.

        `reward`: (S, A); None: the reward that the agent pursues, which is the information gain if it has no goal (see
        `External.combined`). `beliefs`: outcome model; None: that of the agent. `key`: name of the plan; each plan starts from the values
        of the previous plan with the same name.
        """


Explorer = Callable[[Explorable, int, np.random.Generator], Array]


"""A function of agent, state and random generator that returns the score of each action of the state, shape (actions,).

The agent takes the action with the highest score; if several have it, a random one of them. The generator has a new seed for each
transition. Everything else in the scores must depend only on the agent's settings and transitions.
"""


@dataclass(frozen=True, slots=True)
class SampledBeliefs:
    """A transition model that was drawn at random from the posterior: `outcomes` (states) and their `probabilities`.

    Each has shape (S, A, B): S states, at most A actions of a state, and at most B outcomes of an action.
    """

    outcomes: Ints
    probabilities: Array


def posterior_sampling(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return the values (A,) of the actions of `state` in a plan with a transition model drawn from the posterior (Strens 2000).

    The value of an action is the expected discounted sum of information gains. The random numbers of the draw stay the same for
    1 / (1 - discount) transitions. During this time the drawn model changes only because the counts change. `rng`: not used.
    """
    model = agent.model
    episode = agent.transitions // round(1.0 / (1.0 - agent.discount))
    normal = _normal(agent.seed, zlib.crc32(agent.part.encode()), episode, model.counts.shape)
    beliefs = SampledBeliefs(model.outcomes, dirichlet(model.counts, normal))
    return agent.plan(model.reward, beliefs, key="posterior_sampling")[1][state, : len(model.space.actions(state))]


def dirichlet(counts: Array, normal: Array) -> Array:
    """Return a draw (..., B) from the Dirichlet distribution with the parameters `counts` (..., B); 0 where the count is 0.

    `normal`: standard normal random numbers, same shape. They become gamma variates by the cube root formula of Wilson and Hilferty (1931),
    which is accurate enough for counts of at least 1. With the same random numbers, small changes of the counts change the result little.
    """
    known = np.maximum(counts, 1.0)
    gamma = np.maximum(1.0 - 1.0 / (9.0 * known) + normal / (3.0 * np.sqrt(known)), 1e-3)
    weights: Array = counts * gamma * gamma * gamma
    weights /= np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    return weights


@lru_cache(maxsize=4)
def _normal(seed: int, part: int, episode: int, shape: tuple[int, ...]) -> Array:
    """Return the random numbers of an episode; those of the existing bins stay when a bin is added."""
    drawn = np.random.default_rng([seed, part, episode]).standard_normal((shape[2], *shape[:2]))
    return np.ascontiguousarray(np.moveaxis(drawn, 0, -1))


EQUAL_SHARE = 0.01  # of the largest gain: action values that differ by less count as equal, since the plan has that tolerance


HORIZONS = 2.0  # length of the simulated plan, in units of 1 / (1 - discount)


def depleting(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return scores (A,) of the actions of `state`: discounted sums of expected information gains; if nearly equal, a second plan decides.

    The explorer `curious` plans with the gain that the last try of each action gave. This explorer plans with the gain that is expected
    from the next try. The expectation uses the outcome probabilities of `TransitionModel.debiased`: real counts and a weak prior. If the
    outcome of an action is certain, the expected gain decreases sooner than the last gain. The gain of an action that was never tried is
    that of an imagined success.

    If the scores of several actions are below the highest score by at most 1 % of the largest gain, the first plan is simulated from the
    present state with the most probable outcome of each action, and the gains of the simulated actions are reduced as if these outcomes
    were observed. The reduced gains are the rewards of a second plan. The score of each of the several actions is then its expected gain
    plus the discounted value that the second plan has after it; the other actions get -inf. The purpose of the second plan is to prefer a
    state with sixteen untried actions to a state with one. Both plans use the outcome model `agent.beliefs`. Raises InvalidValue if the
    agent's divergence is neither "kail" nor "kl".
    """
    model, actions = agent.model, len(agent.model.space.actions(state))
    if model.divergence not in DIVERGENCES:
        raise InvalidValue(f"depleting cannot expect rewards of the divergence {model.divergence!r}: take {' or '.join(DIVERGENCES)}.")
    beliefs, counts, totals = model.debiased(), *_next_counts(model)
    gains = model.reward.copy()
    _core().expected_gains(beliefs.table, counts, totals, model.tries, gains)
    _, action_values = agent.plan(gains, key="depleting")
    scores = action_values[state, :actions]
    equal = scores >= scores.max() - EQUAL_SHARE * gains.max()
    if np.count_nonzero(equal) == 1:
        return scores
    left, steps = gains.copy(), round(HORIZONS / (1.0 - agent.discount))
    _core().deplete(beliefs.table, counts, totals, action_values, state, steps, left)
    _, afterwards = agent.plan(left, key="depleted")
    later = afterwards[state, :actions] - left[state, :actions]
    return np.where(equal, gains[state, :actions] + later, -np.inf)


def _next_counts(model: TransitionModel) -> tuple[Array, Array]:
    """Return the counts (S, A, B), and their totals (S, A), from which the gain of the next observation is computed."""
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0) * model.forgetting
    floor = model.imagined if model.divergence == "kail" else np.ones_like(model.imagined)
    forgotten = 0.0 if model.forgetting == 1.0 else (1.0 / model.forgetting - 1.0) * real.sum(axis=-1)
    return real + floor, model.totals - forgotten


@cache
def _core() -> ModuleType:
    """Import the native functions when they are first needed."""
    from mobee._core import learning

    return learning


TIE_MARGIN = 1e-12  # scores that differ by less are a tie


def curious(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return the values (A,) of the actions of `state` in a plan for information gain (thesis Algorithm 8).

    If the agent pursues a goal, the plan is for this goal instead. The value of an action is the expected discounted sum of rewards. `rng`
    is not used.
    """
    return agent.plan()[1][state, : len(agent.model.space.actions(state))]


def random(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return the score 0 for each action of `state`, shape (A,), so that each is taken with the same probability."""
    return np.zeros(len(agent.model.space.actions(state)))


def least_tried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return scores (A,) of the actions of `state`: minus the number of tries, so that the action with the fewest tries is taken."""
    return -agent.model.tries[state, : len(agent.model.space.actions(state))].astype(np.float64)


def nearest_untried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return scores (A,) of the actions of `state`: the sooner an action leads to a state-action that was never tried, the higher.

    If all state-actions were tried, those with the fewest tries take their place. The scores are the values of the actions in a plan in
    which these state-actions have the reward 1 and all others 0. `rng` is not used.
    """
    tries = agent.model.tries
    exists = agent.model.reward != -np.inf
    reward = np.where(exists, tries == tries[exists].min(), -np.inf)
    return agent.plan(reward, key="nearest_untried")[1][state, : len(agent.model.space.actions(state))]


def count_bonus(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Return the values (A,) of the actions of `state` in a plan in which rarely tried state-actions have high rewards.

    The reward of a state-action is 1 / sqrt(1 + tries), with the number of its tries (Strehl and Littman 2008). The value of an action is
    the expected discounted sum of rewards. `rng` is not used.
    """
    reward = np.where(agent.model.reward != -np.inf, 1.0 / np.sqrt(1.0 + agent.model.tries), -np.inf)
    return agent.plan(reward, key="count_bonus")[1][state, : len(agent.model.space.actions(state))]


EXPLORERS: dict[str, Explorer] = {
    "curious": curious,
    "random": random,
    "least_tried": least_tried,
    "nearest_untried": nearest_untried,
    "count_bonus": count_bonus,
    "posterior_sampling": posterior_sampling,
    "depleting": depleting,
}


def choose(scores: Array, rng: np.random.Generator) -> int:
    """Return the index of the highest of the scores (actions,); if several are within 1e-12 of it, a random one of them."""
    listed = scores.tolist()  # NumPy takes longer for so few numbers
    least = max(listed) - TIE_MARGIN
    ties = [action for action, score in enumerate(listed) if score >= least]
    return ties[0] if len(ties) == 1 else ties[int(rng.random() * len(ties))]


class Draws:
    """Random generators for numbered decisions: the random numbers of a decision depend only on a seed, a name and its number.

    All decisions share one generator, whose state is set for each decision, because making a generator takes ten times as long. `name`: two
    objects with different names give different random numbers for the same seed.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._generator = _LazyGenerator(np.random.PCG64(0))

    def __reduce__(self) -> tuple[type[Draws], tuple[str]]:
        return Draws, (self._name,)

    def at(self, seed: int, count: int) -> np.random.Generator:
        """Return the random generator of one decision, before it has drawn a number.

        `count`: the number of the decision. All calls return the same object: use it only until the next call, which resets it.
        """
        self._generator.pending = f"{self._name} {seed} {count}"
        return self._generator


class _LazyGenerator(np.random.Generator):
    """A generator whose state is set at the first use: most are never used, and setting the state takes microseconds."""

    pending: str | None = None
    """Text from which its state is derived at the next use; None: the state is set."""

    def __getattribute__(self, name: str) -> Any:
        own = super().__getattribute__
        pending = own("pending")
        if pending is not None:
            self.pending = None
            own("bit_generator").state = _state(pending)
        return own(name)


def _state(name: str) -> dict[str, Any]:
    drawn = hashlib.blake2b(name.encode(), digest_size=32).digest()
    state, stream = int.from_bytes(drawn[:16], "little"), int.from_bytes(drawn[16:], "little") | 1
    return {"bit_generator": "PCG64", "state": {"state": state, "inc": stream}, "has_uint32": 0, "uinteger": 0}
