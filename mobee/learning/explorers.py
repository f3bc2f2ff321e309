"""Explorers score the actions of a state: curiosity, the thesis' rivals, and anchors from the literature."""

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
    """An agent, as its explorer sees it."""

    model: TransitionModel
    beliefs: OutcomeModel
    discount: float
    seed: int
    part: str
    transitions: int

    def plan(self, reward: Array | None = None, beliefs: OutcomeModel | None = None, key: str = "curious") -> tuple[Array, Array]:
        """State and action values, (S,) and (S, A), under a reward (S, A) and beliefs, else the agent's own.

        Plans of one key start from the values of the one before.
        """


Explorer = Callable[[Explorable, int, np.random.Generator], Array]


"""Gives the score of each action of a state, shape (actions,).  The highest is chosen, ties at random.

The scores follow from the agent's settings and its transitions so far alone; the generator is the transition's own.
"""


@dataclass(frozen=True, slots=True)
class SampledBeliefs:
    """Probabilities (S, A, B) drawn for the outcomes (S, A, B) of a transition model."""

    outcomes: Ints
    probabilities: Array


def posterior_sampling(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted information gain in a world drawn from the posterior (Strens 2000).

    The world is held for an episode of 1 / (1 - discount) transitions: its random numbers are, while the counts go on.
    """
    model = agent.model
    episode = agent.transitions // round(1.0 / (1.0 - agent.discount))
    normal = _normal(agent.seed, zlib.crc32(agent.part.encode()), episode, model.counts.shape)
    beliefs = SampledBeliefs(model.outcomes, dirichlet(model.counts, normal))
    return agent.plan(model.reward, beliefs, key="posterior_sampling")[1][state, : len(model.space.actions(state))]


def dirichlet(counts: Array, normal: Array) -> Array:
    """One draw of the probabilities (..., B) with these counts (..., B) from standard normal numbers of the same shape.

    Gamma variates by Wilson and Hilferty's cube root (1931), near enough for counts from 1: the same numbers give
    probabilities that move little when the counts do.  Where there is no count the probability is 0.
    """
    known = np.maximum(counts, 1.0)
    gamma = np.maximum(1.0 - 1.0 / (9.0 * known) + normal / (3.0 * np.sqrt(known)), 1e-3)
    weights: Array = counts * gamma * gamma * gamma
    weights /= np.maximum(weights.sum(axis=-1, keepdims=True), np.finfo(np.float64).tiny)
    return weights


@lru_cache(maxsize=4)
def _normal(seed: int, part: int, episode: int, shape: tuple[int, ...]) -> Array:
    """The random numbers of an episode: those of the bins that were there stay when another is added."""
    drawn = np.random.default_rng([seed, part, episode]).standard_normal((shape[2], *shape[:2]))
    return np.ascontiguousarray(np.moveaxis(drawn, 0, -1))


EQUAL = 0.01  # of the largest gain: action values that differ by less are taken for equal, as the plan's tolerance is of that size


HORIZONS = 2.0  # how far the plan is followed, in units of 1 / (1 - discount)


def depleting(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer the largest discounted gain to expect next; among equals, what leaves most to be learnt when the plan is done.

    'Curious' is paid the last gain of a state-action, this one what its next observation will be worth on average under
    debiased counts, which tells sooner that an action is certain; what was never tried pays what it was imagined to.
    Then the best plan is followed through its most likely outcomes, the gains met fall as they would, and a second plan
    values what is left: a state with one untried action is worth less than one with sixteen.  Both plans are made with
    the agent's beliefs.
    """
    model, actions = agent.model, len(agent.model.space.actions(state))
    if model.divergence not in DIVERGENCES:
        raise InvalidValue(f"depleting cannot expect rewards of the divergence {model.divergence!r}: take {' or '.join(DIVERGENCES)}.")
    beliefs, counts, totals = model.debiased(), *_next_counts(model)
    gains = model.reward.copy()
    _core().expected_gains(beliefs.table, counts, totals, model.tries, gains)
    _, action_values = agent.plan(gains, key="depleting")
    scores = action_values[state, :actions]
    equal = scores >= scores.max() - EQUAL * gains.max()
    if np.count_nonzero(equal) == 1:
        return scores
    left, steps = gains.copy(), round(HORIZONS / (1.0 - agent.discount))
    _core().deplete(beliefs.table, counts, totals, action_values, state, steps, left)
    _, afterwards = agent.plan(left, key="depleted")
    later = afterwards[state, :actions] - left[state, :actions]
    return np.where(equal, gains[state, :actions] + later, -np.inf)


def _next_counts(model: TransitionModel) -> tuple[Array, Array]:
    """The counts (S, A, B) and their totals (S, A) over which the next observation's gain will be taken."""
    real = np.where(model.counts > 0.0, model.counts - model.imagined, 0.0) * model.forgetting
    floor = model.imagined if model.divergence == "kail" else np.ones_like(model.imagined)
    forgotten = 0.0 if model.forgetting == 1.0 else (1.0 / model.forgetting - 1.0) * real.sum(axis=-1)
    return real + floor, model.totals - forgotten


@cache
def _core() -> ModuleType:
    """Loaded when it is first needed."""
    from mobee._core import learning

    return learning


TIE = 1e-12


def curious(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted information gain."""
    return agent.plan()[1][state, : len(agent.model.space.actions(state))]


def random(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer nothing."""
    return np.zeros(len(agent.model.space.actions(state)))


def least_tried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what was tried least often from here."""
    return -agent.model.tries[state, : len(agent.model.space.actions(state))].astype(np.float64)


def nearest_untried(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what leads soonest to a state-action that nobody has tried; when there is none, to the least tried of all."""
    tries = agent.model.tries
    exists = agent.model.reward != -np.inf
    reward = np.where(exists, tries == tries[exists].min(), -np.inf)
    return agent.plan(reward, key="nearest_untried")[1][state, : len(agent.model.space.actions(state))]


def count_bonus(agent: Explorable, state: int, rng: np.random.Generator) -> Array:
    """Prefer what promises the largest discounted sum of 1 / sqrt(1 + tries) (Strehl and Littman 2008)."""
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
    """The action with the highest score, uniformly at random among those within 1e-12 of it."""
    listed = scores.tolist()  # NumPy takes longer for so few numbers
    least = max(listed) - TIE
    ties = [action for action, score in enumerate(listed) if score >= least]
    return ties[0] if len(ties) == 1 else ties[int(rng.random() * len(ties))]


class Draws:
    """One generator that is set anew for every count, which takes a tenth of the time of making one.

    `name`: tells apart who draws under the same seed.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._generator = _Late(np.random.PCG64(0))

    def __reduce__(self) -> tuple[type[Draws], tuple[str]]:
        return Draws, (self._name,)

    def at(self, seed: int, count: int) -> np.random.Generator:
        """The generator at the beginning of the draws of a count; valid until the next call."""
        self._generator.waiting = f"{self._name} {seed} {count}"
        return self._generator


class _Late(np.random.Generator):
    """A generator that is set when it is first asked for anything: most who get one draw nothing, and setting takes microseconds."""

    waiting: str | None = None
    """What its next state follows from; None: it is set."""

    def __getattribute__(self, name: str) -> Any:
        own = super().__getattribute__
        waiting = own("waiting")
        if waiting is not None:
            self.waiting = None
            own("bit_generator").state = _state(waiting)
        return own(name)


def _state(name: str) -> dict[str, Any]:
    drawn = hashlib.blake2b(name.encode(), digest_size=32).digest()
    state, stream = int.from_bytes(drawn[:16], "little"), int.from_bytes(drawn[16:], "little") | 1
    return {"bit_generator": "PCG64", "state": {"state": state, "inc": stream}, "has_uint32": 0, "uinteger": 0}
