# SPDX-License-Identifier: Apache-2.0
"""The transition model: outcome counts of every state-action, and the information gain of an observation (thesis 6.4)."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from math import isfinite, log1p
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.arrays import Array, Ints, is_number
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.neighbours import NO_ACTION
from mobee.learning.runs import OutcomeRuns
from mobee.learning.space import Space
from mobee.learning.value_iteration import OutcomeModel, Tabled
from mobee.settings import named

if TYPE_CHECKING:
    from mobee._core import learning
    from mobee._core.learning import OutcomeCounts, TransitionTable


def kl_divergence(p: ArrayLike, t: ArrayLike) -> float:
    """Return the Kullback-Leibler divergence KL(P || T) in nats of two distributions over the same outcomes (thesis eq. 6.5).

    `p`, `t`: counts or probabilities, shape (bins,), all above 0 (otherwise it is undefined, thesis 6.4.2); they are normalised here.
    Raises InvalidValue if the shapes differ, or a number is not finite or not above 0.
    """
    new, old = np.asarray(p, dtype=np.float64), np.asarray(t, dtype=np.float64)
    if new.ndim != 1 or new.shape != old.shape or not len(new):
        raise InvalidValue(f"distributions of shapes {new.shape} and {old.shape}: give two vectors over the same bins.")
    if not ((new > 0).all() and (old > 0).all() and np.isfinite(new).all() and np.isfinite(old).all()):
        raise InvalidValue(f"KL divergence needs components above zero, given {new.tolist()} and {old.tolist()}: leave empty bins out.")
    new, old = new / new.sum(), old / old.sum()
    return float((new * np.log(new / old)).sum())


def information_gain(count: float, total: float) -> float:
    """Return the information gain in nats of an observation that adds 1 to the count of one outcome.

    `count`: the count of this outcome, above 0, and `total`: the sum over all outcomes, both before the observation. The gain is the
    Kullback-Leibler divergence KL(P || T) of the distribution P after the observation from T before it. This is a closed form of eq. 6.5,
    because all other probabilities change by the factor total / (total + 1).
    """
    gain = (count + 1.0) / (total + 1.0) * log1p(1.0 / count) - log1p(1.0 / total)
    return max(0.0, gain)  # rounding


Scalar = TypeVar("Scalar", bound=np.generic)


def widened(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a copy of an array (S, A, B) with one more outcome (last axis), filled with 0."""
    return np.pad(array, [(0, 0)] * (array.ndim - 1) + [(0, 1)])


def read_only(array: NDArray[Scalar]) -> NDArray[Scalar]:
    """Return a view of an array through which the array cannot be changed."""
    view = array.view()
    view.setflags(write=False)
    return view


class DebiasedCounts(Tabled):
    """Outcome probabilities from real counts and a weak prior; its `TransitionModel` keeps them up to date.

    The imagined counts of Algorithms 6 and 8 keep the reward finite, but bias plans: after n successes, an action that never failed still
    has a probability of 2 / (4 + n) to fail.

    Args:
        model: the model that lists the possible outcomes (states) of each action; their order is that of `real`.
        real: (S, A, B) how often each outcome was really observed.
        weight: (S, A) the sums of `real` over the outcomes.
        goal, stay: imagined counts of an action's success (it ends in its goal) and of its failure (it stays); other outcomes have none.
    """

    def __init__(self, model: OutcomeModel, real: Array, weight: Array, goal: float, stay: float) -> None:
        self._model = model
        self._prior: Array = np.zeros(real.shape[-1])
        self._prior[:2] = stay, goal
        self._sum = stay + goal
        probabilities = (real + self._prior) / (weight[:, :, None] + self._sum)
        self._probabilities: Array = np.where(model.probabilities.any(axis=-1, keepdims=True), probabilities, 0.0)
        self._believed: learning.DebiasedCounts | None = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_believed": None, "_table": None}  # a copy has arrays of its own

    @property
    def outcomes(self) -> Ints:
        """The state of each outcome, shape (S states, A actions, B outcomes); meaningless where the probability is 0."""
        return self._model.outcomes

    @property
    def probabilities(self) -> Array:
        """The probability of each outcome, shape (S, A, B): the sum over B is 1, or 0 where there is no action (read only).

        B is the largest number of distinct outcomes of a state-action.
        """
        return read_only(self._probabilities)

    def update(self, counts: OutcomeCounts, state: int, action: int) -> None:
        """Update the probabilities of a state-action from its real counts in `counts`."""
        believed = self._believed or self._believe()
        _core().believe(counts.at, believed.at, state, action)

    def widen(self) -> None:
        """Add one more outcome, of probability 0, to the tables of all state-actions."""
        self._prior, self._probabilities = np.append(self._prior, 0.0), widened(self._probabilities)
        self._believed = self._table = None

    def _believe(self) -> learning.DebiasedCounts:
        """Return the probabilities as the core reads them."""
        self._believed = _core().DebiasedCounts(self._probabilities, self._prior, self._sum)
        return self._believed

    def _tabled(self) -> TransitionTable:
        from mobee._core.learning import TransitionTable

        return TransitionTable(self._probabilities, self._model.outcomes)


@cache
def _core() -> Any:
    """Import the native functions when they are first needed."""
    from mobee._core import learning

    return learning


INITIAL = {"50-50": (2.0, 2.0), "60-40": (2.0, 3.0)}  # imagined counts of staying and of reaching the goal: Algorithm 8 and table 7.1
DETECTORS = "none", "run_length"
NEW_BIN = 1.0  # imagined count of the bins beyond these two: Algorithm 6

Divergence = Callable[[Array, Array], float]
"""A function of the distributions of outcomes after and before an observation that returns the reward of the observation in nats.

Both distributions: shape (bins,), all above 0, of sum 1.
"""

DIVERGENCES: dict[str, Divergence] = {"kail": kl_divergence, "kl": kl_divergence}
"""By name, the divergences of the library: "kail" is over the observed outcomes of a state-action, "kl" over all states.

The compiled core computes both in closed form.
"""


class TransitionModel(Tabled):
    """Counts of the outcomes of every state-action, and as reward the information gain of its last observation (thesis 6.4.3).

    Each distinct outcome state of a state-action has a bin with its count; a new outcome adds a bin. An observation takes a few
    microseconds for any size of the space; memory grows with the number of different outcomes.

    Args:
        space: the states and actions.
        initial: the outcomes that each action is imagined to have had before its first try: "50-50": one failure (it stays) and one success
            (it reaches its goal); "60-40": one failure and two successes.
        divergence: the reward of an observation: "kail" (Algorithm 6: KL divergence over the bins of the state-action); "kl" (thesis 6.4.2:
            KL divergence over all states, each with one imagined observation); a function, see `Divergence`; or the text `module:name` of
            such a function. It does not change the probabilities.
        forgetting: in (0, 1]; the real counts of a state-action are multiplied by this before each of its observations.
        detector: "run_length": detect changes of the outcomes; each real count is then the expected number of observations since the last
            change, see `OutcomeRuns`. "none": all observations count.

    Raises:
        InvalidValue, UnknownName: an argument is out of its range or unknown; the message states the valid ones.
    """

    def __init__(
        self,
        space: Space,
        initial: str = "50-50",
        divergence: str | Divergence = "kail",
        forgetting: float = 1.0,
        detector: str = "none",
    ) -> None:
        if initial not in INITIAL:
            raise UnknownName("initial", initial, INITIAL)
        if detector not in DETECTORS:
            raise UnknownName("detector", detector, DETECTORS)
        if detector != "none" and forgetting != 1.0:
            raise InvalidValue(
                f"detector={detector!r} with forgetting={forgetting!r}: it determines what is forgotten; leave forgetting at 1."
            )
        name, function = named("divergence", divergence, DIVERGENCES)
        if not 0.0 < forgetting <= 1.0:
            raise InvalidValue(f"forgetting={forgetting!r}: valid are 0 (exclusive) to 1, which forgets nothing.")
        self.space, self.initial, self.divergence, self.forgetting = space, initial, name, float(forgetting)
        self._function = None if name in DIVERGENCES else function
        stay, goal = INITIAL[initial]
        goals = np.ascontiguousarray(space.goals)
        exists = goals != NO_ACTION
        self._imagined: Array = np.array([stay, goal])  # of each bin, as long as the bins of the widest state-action
        self._counts: Array = np.where(exists[:, :, None], self._imagined, 0.0)  # (S, A, bins), 0 where there is no bin
        self._probabilities: Array = self._counts / (stay + goal)
        states = np.broadcast_to(np.arange(len(space))[:, None], exists.shape)
        self._outcomes: Ints = np.where(exists[:, :, None], np.stack([states, goals], axis=-1), 0)
        self._bins: Ints = np.where(exists, 2, 0)
        self._weight: Array = np.zeros(exists.shape)  # sum of the real counts
        self._tries: Ints = np.zeros(exists.shape, dtype=np.intp)
        dense = name == "kl"
        first = information_gain(1.0, len(space)) if dense else information_gain(goal - 1.0, stay + goal - 1.0)
        if self._function is not None:
            first = self._valued(np.array([stay, goal]), np.array([stay, goal - 1.0]))
        self._reward: Array = np.where(exists, first, -np.inf)
        self._totals: Array = np.where(exists, float(len(space)) if dense else stay + goal, 0.0)
        self._debiased: dict[tuple[float, float], DebiasedCounts] = {}
        self._counted: OutcomeCounts | None = None
        self._runs = None if detector == "none" else OutcomeRuns(space)

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {"_counted": None, "_table": None}  # a copy has arrays of its own

    @property
    def reward(self) -> Array:
        """The information gain of each state-action's last observation, shape (S, A) [nats]; -inf where there is no action (read only).

        Before the first try it is the gain of an imagined success. If `divergence` is a function, its value stands in place of the gain.

        With the detector "run_length", an observation can also raise the gains of other actions, if the outcomes of the observed action
        seem to have changed. This concerns all actions of any state that have the same goal as the observed action, and the action from
        this goal back to the state, but only actions that have been tried.
        """
        return read_only(self._reward)

    @property
    def tries(self) -> Ints:
        """The number of real observations of each state-action, shape (S, A) (read only)."""
        return read_only(self._tries)

    @property
    def outcomes(self) -> Ints:
        """The outcome state of each bin, shape (S, A, B); meaningless where the probability is 0.

        A bin is one distinct outcome of a state-action; B is the largest number of bins. Bin 0 is the state itself, bin 1 the goal of the
        action; the others are in order of first observation.
        """
        return read_only(self._outcomes)

    @property
    def probabilities(self) -> Array:
        """The probability of each bin, shape (S, A, B): the sum over B is 1, or 0 where there is no action (read only).

        A bin is one distinct outcome of a state-action; B is the largest number of bins.
        """
        return read_only(self._probabilities)

    @property
    def counts(self) -> Array:
        """The count of each bin, T(s, a) of the thesis, shape (S, A, B); 0 where there is no bin (read only).

        A bin is one distinct outcome of a state-action; B is the largest number of bins. Imagined observations are included.
        """
        return read_only(self._counts)

    @property
    def totals(self) -> Array:
        """The sum of the counts of each state-action, N in the closed form of eq. 6.5, (S, A); 0 where there is no action (read only).

        It is the sum over the bins (the distinct outcomes) of real and imagined counts; imagined counts are a prior: outcomes that are
        counted before they were observed. With the divergence "kl" it is the sum of the real counts plus one imagined count for each state
        of the space.
        """
        return read_only(self._totals)

    @property
    def imagined(self) -> Array:
        """The imagined observations in the count of each bin, shape (B,) (read only).

        A bin is one distinct outcome of a state-action, B the largest number of bins. Bin 0: the action stays; bin 1: it reaches its goal;
        the others: further outcomes. The values are the same for all state-actions.
        """
        return read_only(self._imagined)

    def bins(self, state: int, action: int) -> tuple[Ints, Array]:
        """Return the outcome states of a state-action and their counts T(s, a), both (bins,), in the order of `outcomes`.

        `bins`: number of distinct outcomes of the state-action. Imagined observations are included.
        """
        self.space.goal(state, action)
        used = self._bins[state, action]
        return self._outcomes[state, action, :used].copy(), self._counts[state, action, :used].copy()

    def debiased(self, goal: float = 0.3, stay: float = 0.1) -> DebiasedCounts:
        """Return outcome probabilities for planning, from the real counts and a weak prior. Later observations of this model update them.

        `goal`, `stay`: the prior: imagined counts of an action's success (it ends in its goal; above 0) and of its failure (it stays; at
        least 0). They replace all imagined counts of this model (see `initial`). A second call with the same two numbers returns the same
        object. Raises InvalidValue for a number out of its range.
        """
        if not (0.0 < goal < np.inf and 0.0 <= stay < np.inf):
            raise InvalidValue(f"goal={goal!r}, stay={stay!r}: give counts, the first above 0 and the second at least 0.")
        if (goal, stay) not in self._debiased:
            real = np.where(self._counts > 0.0, self._counts - self.imagined, 0.0)
            self._debiased[goal, stay] = DebiasedCounts(self, real, self._weight, goal, stay)
        return self._debiased[goal, stay]

    def gain(self, state: int, action: int, outcome: int) -> float:
        """Return the information gain [nats] of a transition from `state` by `action` to the state `outcome`; the model is not changed."""
        self._check(state, action, outcome)
        if self._runs is not None:
            return self._gain_since_change(int(state), int(action), int(outcome))
        if self._function is not None:
            return self._own_gain(int(state), int(action), int(outcome))
        counted = self._counted or self._count()
        found: float = _core().gain(counted.at, int(state), int(action), int(outcome))
        return found

    def observe(self, state: int, action: int, outcome: int) -> float:
        """Count one real transition from `state` by `action` to the state `outcome`; return its reward in nats (Algorithm 6).

        Raises InvalidValue for a state or action that the space does not have.
        """
        self._check(state, action, outcome)
        if self._runs is not None:
            return self._observe_since_change(int(state), int(action), int(outcome))
        observed, counted = (int(state), int(action), int(outcome)), self._counted or self._count()
        own = None if self._function is None else self._own_gain(*observed)
        reward: float = _core().observe(counted.at, *observed)
        if reward < 0.0:
            self._widen()
            counted = self._count()
            reward = _core().observe(counted.at, *observed)
        for beliefs in self._debiased.values():
            beliefs.update(counted, *observed[:2])
        if own is not None:
            reward = self._reward[state, action] = own
        return reward

    def _gain_since_change(self, state: int, action: int, outcome: int) -> float:
        """Return the reward of an observation: the change of the belief, in which earlier outcomes may be forgotten."""
        assert self._runs is not None
        chosen, bins = self._bin(state, action, outcome), int(self._bins[state, action])
        bins = max(bins, chosen + 1)
        imagined = np.append(self._imagined, NEW_BIN)[:bins]
        before, after = self._runs.counts(state, action, bins) + imagined, self._runs.following(state, action, chosen, bins) + imagined
        if self._function is not None:
            return self._valued(after, before)
        if self.divergence == "kl":  # all other states have the same count, 1
            others = len(self.space) - bins
            before, after = (np.append(counts - imagined + 1.0, others) for counts in (before, after))
        return max(0.0, kl_divergence(after, before))

    def _observe_since_change(self, state: int, action: int, outcome: int) -> float:
        """Count one transition, forget the outcomes before a change, and return the reward of the transition in nats.

        If neighbours of the state-action (see `OutcomeRuns`) may have changed too, each gets at least the reward of its likeliest outcome.
        """
        assert self._runs is not None
        reward, chosen = self._gain_since_change(state, action, outcome), self._bin(state, action, outcome)
        if chosen == self._outcomes.shape[2]:
            self._widen()
        self._outcomes[state, action, chosen] = outcome
        self._bins[state, action] = max(self._bins[state, action], chosen + 1)
        suspect = self._runs.observe(state, action, chosen, int(self._bins[state, action]))
        self._tries[state, action] += 1
        self._reward[state, action] = reward
        self._recount(state, action)
        for near in suspect:
            self._recount(*near)
            likely = int(self._outcomes[near][self._counts[near].argmax()])
            self._reward[near] = max(self._reward[near], self._gain_since_change(*near, likely))
        return reward

    def _recount(self, state: int, action: int) -> None:
        """Write the counts of the present run of a state-action into the tables."""
        assert self._runs is not None
        used = int(self._bins[state, action])
        real = self._runs.counts(state, action, used)
        counts = real + self._imagined[:used]
        self._counts[state, action, :used] = counts
        self._probabilities[state, action, :used] = counts / counts.sum()
        self._weight[state, action] = real.sum()
        self._totals[state, action] = real.sum() + len(self.space) if self.divergence == "kl" else counts.sum()
        for beliefs in self._debiased.values():
            beliefs.update(self._counted or self._count(), state, action)

    def _bin(self, state: int, action: int, outcome: int) -> int:
        """Return the bin of an outcome; for a new outcome, the next free bin."""
        used = int(self._bins[state, action])
        same = np.flatnonzero(self._outcomes[state, action, :used] == outcome)
        return int(same[0]) if len(same) else used

    def _own_gain(self, state: int, action: int, outcome: int) -> float:
        """Return the reward of an observation by the user's divergence function, for the counts before and after it (Algorithm 6)."""
        states, counts = self.bins(state, action)
        imagined = self._imagined[: len(counts)]
        before = (counts - imagined) * self.forgetting + imagined
        same = np.flatnonzero(states == outcome)
        if not len(same):
            before = np.append(before, NEW_BIN)
        after = before.copy()
        after[same[0] if len(same) else -1] += 1.0
        return self._valued(after, before)

    def _valued(self, after: Array, before: Array) -> float:
        """Return the user's divergence for counts after and before; raises InvalidValue if the function returns no finite number."""
        assert self._function is not None
        value = self._function(after / after.sum(), before / before.sum())
        if not (is_number(value) and isfinite(value)):
            raise InvalidValue(f"divergence {self.divergence!r} returned {value!r}: return a finite number, in nats.")
        return float(value)

    def _check(self, state: int, action: int, outcome: int) -> None:
        self.space.goal(state, action)
        if not (isinstance(outcome, (int, np.integer)) and 0 <= outcome < len(self._reward)):
            raise InvalidValue(f"{self.space.part} has no state {outcome!r}: valid are 0 to {len(self.space) - 1}.")

    def _widen(self) -> None:
        """Make room for one more bin (distinct outcome) of each state-action in the arrays of counts, probabilities and outcomes."""
        self._imagined = np.append(self._imagined, NEW_BIN)
        self._counts, self._probabilities = widened(self._counts), widened(self._probabilities)
        self._outcomes = widened(self._outcomes)
        self._counted = self._table = None
        for beliefs in self._debiased.values():
            beliefs.widen()

    def _count(self) -> OutcomeCounts:
        """Return the counts as the core reads and writes them."""
        arrays = {
            "count": self._counts,
            "probability": self._probabilities,
            "outcome": self._outcomes,
            "used": self._bins,
            "weight": self._weight,
            "total": self._totals,
            "reward": self._reward,
            "tries": self._tries,
            "imagined": self._imagined,
        }
        over_states = len(self.space) if self.divergence == "kl" else 0
        self._counted = _core().OutcomeCounts(arrays, over_states, self.forgetting)
        return self._counted

    def _tabled(self) -> TransitionTable:
        from mobee._core.learning import TransitionTable

        return TransitionTable(self._probabilities, self._outcomes, self._bins)
