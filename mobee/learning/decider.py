"""Chooses actions from a transition model by planning, without acting (thesis Algorithms 7 and 8)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, UnknownName
from mobee.learning.draws import Draws
from mobee.learning.explorers import EXPLORERS, Explorer, choose
from mobee.learning.goal import Goal, pursued
from mobee.learning.named import named
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel, value_iteration
from mobee.store import Transition


class _Made(NamedTuple):
    """A plan, and for what it was asked."""

    reward: Array | None
    beliefs: OutcomeModel | None
    plan: tuple[Array, Array]


class Plans:
    """Plans by key: made once a transition, forgotten with it when it is interrupted, kept as next start when it is observed.

    `relative`: with a tolerance in units of the largest reward and warm starts; else Algorithm 7 as published, with an
    absolute tolerance and every value zero at the start.  Raises InvalidValue for a discount or tolerance out of range.
    """

    def __init__(self, discount: float, tolerance: float, relative: bool) -> None:
        if not (0.0 <= discount < 1.0 and 0.0 < tolerance < np.inf):
            raise InvalidValue(f"discount={discount!r}, tolerance={tolerance!r}: valid are 0 <= discount < 1 and a tolerance above 0.")
        self.discount, self.tolerance, self.relative = discount, tolerance, relative
        self._starts: dict[str, Array] = {}
        self._made: dict[str, _Made] = {}

    def made(self, key: str, reward: Array | None, beliefs: OutcomeModel | None) -> tuple[Array, Array] | None:
        """The plan of a key made since the last transition, if it was asked for with the same objects."""
        made = self._made.get(key)
        return made.plan if made is not None and made.reward is reward and made.beliefs is beliefs else None

    def make(
        self, key: str, asked: Array | None, believed: OutcomeModel | None, reward: Array, beliefs: OutcomeModel
    ) -> tuple[Array, Array]:
        """Plan for a reward (S, A) with beliefs, and remember it under what it was asked for."""
        if self.relative:
            before = self._made.get(key)
            start = self._starts.get(key) if before is None else before.plan[0]
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance, start, relative=True, method="modified")
        else:
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance)
        for values in plan:
            values.setflags(write=False)
        self._made[key] = _Made(asked, believed, plan)
        return plan

    def keep(self) -> None:
        """A transition was observed: what was planned before it is where the next plans start."""
        for key, made in self._made.items():
            self._starts[key] = made.plan[0]
        self._made.clear()

    def undo(self) -> None:
        """The action was interrupted: nothing was planned."""
        self._made.clear()


BELIEFS = ("counts", "debiased")


class Decider:
    """Learns from transitions and chooses actions; what it chooses follows from its settings and the transitions so far.

    The settings, and what they raise, are those of `CuriousAgent`.
    """

    def __init__(
        self,
        space: Space,
        explorer: str | Explorer,
        seed: int,
        discount: float,
        initial: str,
        divergence: str,
        forgetting: float,
        tolerance: float,
        relative: bool,
        beliefs: str,
        goal: Goal | None,
        goal_weight: float | None,
    ) -> None:
        if beliefs not in BELIEFS:
            raise UnknownName("beliefs", beliefs, BELIEFS)
        self.space, self.part = space, space.part
        self.explorer, self._score = named("explorer", explorer, EXPLORERS)
        self.seed, self.discount = seed, discount
        self.model = TransitionModel(space, initial, divergence, forgetting)
        self.beliefs: OutcomeModel = self.model.debiased() if beliefs == "debiased" else self.model
        """What plans are made with."""
        self.transitions = 0
        """How many transitions this agent has observed, those of its store included."""
        self.last: Transition | None = None
        """The newest transition."""
        self._believes = beliefs
        self._external = pursued(space, goal, goal_weight, self.explorer)
        self._plans = Plans(discount, tolerance, relative)
        self._draws = Draws(space.part)

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides what the agent does, as plain JSON values."""
        return {
            "space": self.space.settings,
            "explorer": self.explorer,
            "seed": self.seed,
            "discount": self.discount,
            "initial": self.model.initial,
            "divergence": self.model.divergence,
            "forgetting": self.model.forgetting,
            "tolerance": self._plans.tolerance,
            "relative": self._plans.relative,
            "beliefs": self._believes,
            "goal": None if self._external is None else self._external.settings,
        }

    def plan(self, reward: Array | None = None, beliefs: OutcomeModel | None = None, key: str = "curious") -> tuple[Array, Array]:
        """State and action values, shapes (S,) and (S, A), made once a transition (Algorithm 7).

        `reward`: (S, A), else what the agent pursues: the intrinsic reward, or the goal's.  `beliefs`: else the agent's.
        `key`: plans of one key start from the values of the one before.
        """
        plan = self._plans.made(key, reward, beliefs)
        if plan is None:
            wanted = self._pursued() if reward is None else reward
            plan = self._plans.make(key, reward, beliefs, wanted, self.beliefs if beliefs is None else beliefs)
        return plan

    def _choose(self, state: int) -> int:
        draws = self._draws.at(self.seed, self.transitions)
        scores = self._score(self, state, draws)
        if self.explorer not in EXPLORERS:
            self._require_scores(scores, state)
        return choose(scores, draws)

    def _require_scores(self, scores: Array, state: int) -> None:
        """Raise InvalidValue unless an explorer from outside gives a number for each action of the state."""
        actions = len(self.space.actions(state))
        if np.shape(scores) != (actions,) or np.isnan(scores).any():
            raise InvalidValue(
                f"explorer {self.explorer!r} gave {scores!r} in state {state}: give a score for each action, shape ({actions},)."
            )

    def _learn(self, transition: Transition) -> None:
        self.model.observe(transition.s, transition.a, transition.s_next)
        self._go_on(transition)

    def _go_on(self, transition: Transition) -> None:
        """The model has observed this one."""
        self.transitions, self.last = transition.n, transition
        self._plans.keep()

    def _replay(self, transitions: list[Transition]) -> None:
        """Learn from what is on record; each decision is made anew, so that plans start where they would have."""
        for transition in transitions:
            self._score(self, transition.s, self._draws.at(self.seed, self.transitions))
            self._learn(transition)

    def _pursued(self) -> Array:
        return self.model.reward if self._external is None else self._external.combined(self.model.reward)
