"""What a curious agent knows and wants, without what it acts on: model, beliefs, plans, choices (thesis Algorithms 7 and 8)."""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.errors import InvalidValue, UnknownName
from mobee.learning.draws import Draws
from mobee.learning.exploit import Goal, pursued
from mobee.learning.explorable import Explorer
from mobee.learning.explorers import EXPLORERS, choose
from mobee.learning.named import named
from mobee.learning.plans import Plans
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.robot.robot import Array
from mobee.store import Transition

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
