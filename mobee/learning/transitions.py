"""What the agent knows of the outcomes of its actions, and what each new outcome was worth (thesis 6.4)."""

from __future__ import annotations

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.space import Space
from mobee.robot.robot import Array, Ints

Scalar = TypeVar("Scalar", bound=np.generic)
STAY, GOAL = 0, 1  # the first two bins of every state-action
INITIAL = {"50-50": (STAY, GOAL), "60-40": (STAY, GOAL, GOAL)}  # imagined observations: Algorithm 8 and table 7.1


def kl_divergence(p: ArrayLike, t: ArrayLike) -> float:
    """KL(P || T) in nats of two distributions over the same bins, given as counts or probabilities (thesis eq. 6.5).

    `p`, `t`: shape (bins,), every component above zero (else it is undefined, thesis 6.4.2); they are normalised here.
    """
    new, old = np.asarray(p, dtype=np.float64), np.asarray(t, dtype=np.float64)
    if new.ndim != 1 or new.shape != old.shape or not len(new):
        raise InvalidValue(f"distributions of shapes {new.shape} and {old.shape}: give two vectors over the same bins.")
    if not ((new > 0).all() and (old > 0).all() and np.isfinite(new).all() and np.isfinite(old).all()):
        raise InvalidValue(f"KL divergence needs components above zero, given {new.tolist()} and {old.tolist()}: leave empty bins out.")
    return _kl(new, old)


def _kl(p: Array, t: Array) -> float:
    p, t = p / p.sum(), t / t.sum()
    return float((p * np.log(p / t)).sum())


def kail_update(counts: Array, chosen: int) -> tuple[Array, float]:
    """One observation by Algorithm 6: the new counts and the information gain in nats.

    `counts`: (bins,), the T of the thesis' tables; `chosen`: the bin observed, or len(counts) for an outcome never seen before.
    """
    before = np.append(counts, 1.0) if chosen == len(counts) else counts
    after = before.copy()
    after[chosen] += 1.0
    return after, _kl(after, before)


class TransitionModel:
    """Outcome counts of every state-action in bins of variable number, with 'Kail' divergence as reward (thesis 6.4.3).

    Args:
        space: the states and actions.
        initial: "50-50" (each action is imagined to fail once and succeed once) or "60-40" (to succeed twice).
    """

    def __init__(self, space: Space, initial: str = "50-50") -> None:
        if initial not in INITIAL:
            raise UnknownName("initial", initial, INITIAL)
        self.space, self.initial = space, initial
        exists = space.goals != NO_ACTION
        counts, reward = np.empty(0), 0.0
        for chosen in INITIAL[initial]:
            counts, reward = kail_update(counts, chosen)
        self._counts: Array = np.where(exists[:, :, None], counts, 0.0)  # (S, A, bins), 0 where there is no bin
        self._probabilities: Array = self._counts / np.maximum(self._counts.sum(axis=-1, keepdims=True), 1.0)
        stay = np.broadcast_to(np.arange(len(space))[:, None], exists.shape)
        self._outcomes: Ints = np.where(exists[:, :, None], np.stack([stay, space.goals], axis=-1), 0)
        self._bins: Ints = np.where(exists, len(counts), 0)
        self._reward: Array = np.where(exists, reward, -np.inf)
        self._tries: Ints = np.zeros(exists.shape, dtype=np.intp)

    @property
    def reward(self) -> Array:
        """The last information gain of each state-action, shape (S, A), in nats; -inf where there is no action (read only)."""
        return _read_only(self._reward)

    @property
    def tries(self) -> Ints:
        """How often each state-action was really observed, shape (S, A) (read only)."""
        return _read_only(self._tries)

    @property
    def outcomes(self) -> Ints:
        """The state of each bin in order of first observation, shape (S, A, B); meaningless where the probability is 0."""
        return _read_only(self._outcomes)

    @property
    def probabilities(self) -> Array:
        """The probability of each bin, shape (S, A, B): sums to 1 over B, or 0 where there is no action (read only)."""
        return _read_only(self._probabilities)

    def bins(self, state: int, action: int) -> tuple[Ints, Array]:
        """States observed and their counts T(s, a), imagined ones included, in order of first observation."""
        self.space.goal(state, action)
        used = self._bins[state, action]
        return self._outcomes[state, action, :used].copy(), self._counts[state, action, :used].copy()

    def gain(self, state: int, action: int, outcome: int) -> float:
        """The reward that observing this outcome would pay now, in nats; changes nothing."""
        return self._update(state, action, outcome)[2]

    def observe(self, state: int, action: int, outcome: int) -> float:
        """Count one real transition and return its reward in nats (Algorithm 6).

        Raises InvalidValue for a state or action that the space does not have.
        """
        chosen, counts, reward = self._update(state, action, outcome)
        if len(counts) > self._counts.shape[-1]:
            self._counts = np.pad(self._counts, ((0, 0), (0, 0), (0, 1)))
            self._probabilities = np.pad(self._probabilities, ((0, 0), (0, 0), (0, 1)))
            self._outcomes = np.pad(self._outcomes, ((0, 0), (0, 0), (0, 1)))
        self._counts[state, action, : len(counts)] = counts
        self._probabilities[state, action] = self._counts[state, action] / self._counts[state, action].sum()
        self._outcomes[state, action, chosen] = outcome
        self._bins[state, action] = len(counts)
        self._reward[state, action] = reward
        self._tries[state, action] += 1
        return reward

    def _update(self, state: int, action: int, outcome: int) -> tuple[int, Array, float]:
        states, counts = self.bins(state, action)
        if not 0 <= outcome < len(self.space):
            raise InvalidValue(f"{self.space.part} has no state {outcome!r}: valid are 0 to {len(self.space) - 1}.")
        seen = np.flatnonzero(states == outcome)
        chosen = int(seen[0]) if len(seen) else len(states)
        return chosen, *kail_update(counts, chosen)


def _read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    view = array.view()
    view.flags.writeable = False
    return view
