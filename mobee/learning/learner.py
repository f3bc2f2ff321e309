# SPDX-License-Identifier: Apache-2.0
"""The curious learner: learns from transitions and chooses actions by planning, but does not act (thesis Algorithms 7 and 8)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.learning.explorers import EXPLORERS, Draws, Explorer, choose
from mobee.learning.goal import Goal, pursued, require_pursuing
from mobee.learning.space import Space
from mobee.learning.transitions import Divergence, TransitionModel
from mobee.learning.value_iteration import OutcomeModel, value_iteration
from mobee.settings import Range, Settings, named
from mobee.store import Transition


@dataclass(frozen=True, kw_only=True)
class CuriousSettings(Settings):
    """Settings of a `CuriousAgent`.

    Args:
        explorer: how actions are chosen: a name in `mobee.learning.explorers.EXPLORERS`, such as "curious", "random" or "least_tried"; a
            function, see `mobee.learning.explorers.Explorer`; or the text `module:name` of such a function.
        seed: seed of the random choice among equally good actions; with the same seed, agents of different parts choose differently.
        discount: factor of future rewards in plans.
        initial: outcomes of an action that are imagined before it is tried: "50-50" (one failure and one success) or "60-40" (one failure
            and two successes), see `TransitionModel`.
        divergence: the reward of an observation: "kail", "kl", a function, or the text `module:name` of one, see `TransitionModel`.
        forgetting: factor by which the counts of a state-action are multiplied before each new observation of it; 1 forgets nothing.
        detector: "run_length": outcomes from before a detected change of the world are forgotten, see `TransitionModel`; "none": all
            outcomes count.
        tolerance: a plan has converged if no value changes by this or more, see `value_iteration`.
        relative: True: the tolerance is in units of the largest reward, and each plan starts from the values of the previous one. False,
            with tolerance=1e-3: Algorithm 7 as published.
        beliefs: the probabilities with which plans are made: "counts", which include the imagined outcomes, or "debiased", which have a
            weak prior in place of them, see `TransitionModel.debiased`.
        goal: an external reward: target states, an array (S, A), or a function of state, action and goal state; None: curiosity alone.
        goal_weight: the external reward times this factor is added to the intrinsic reward; None: the external reward replaces it.
    """

    explorer: str | Explorer = "curious"
    seed: Annotated[int, Range(ge=0)] = 0
    discount: Annotated[float, Range(ge=0, lt=1)] = 0.9
    initial: Literal["50-50", "60-40"] = "50-50"
    divergence: str | Divergence = "kail"
    forgetting: Annotated[float, Range(gt=0, le=1)] = 1.0
    detector: Literal["none", "run_length"] = "none"
    tolerance: Annotated[float, Range(gt=0)] = 0.01
    relative: bool = True
    beliefs: Literal["counts", "debiased"] = "counts"
    goal: Goal | None = None
    goal_weight: float | None = None


WATCHERS: list[Callable[[CuriousLearner, Transition], None]] = []
"""Functions that are called with the learner and the transition after each transition of every learner of this process.

They are also called for transitions that are read from a store.
"""


class _Made(NamedTuple):
    """A plan, and the reward and beliefs that it was requested for."""

    reward: Array | None
    beliefs: OutcomeModel | None
    plan: tuple[Array, Array]


class Plans:
    """Caches the plans made since the last transition, by name (`key`); a plan is the values of states (S,) and of actions (S, A).

    `discount` and `tolerance`: as in `value_iteration`. `relative`: True: the tolerance is in units of the largest reward, and a plan
    starts from the values of the previous plan of the same name; False: Algorithm 7 as published, with an absolute tolerance and all values
    0 at the start.
    """

    def __init__(self, discount: float, tolerance: float, relative: bool) -> None:
        self.discount, self.tolerance, self.relative = discount, tolerance, relative
        self._starts: dict[str, Array] = {}
        self._made: dict[str, _Made] = {}
        self._used: set[str] = set()  # plans that a decision has requested since the last transition
        self.decides = False
        """Whether plans are requested for a decision at present."""

    def made(self, key: str, reward: Array | None, beliefs: OutcomeModel | None) -> tuple[Array, Array] | None:
        """Return the plan `key` if it was made since the last transition, for the same objects `reward` and `beliefs`; otherwise None.

        A plan is the values of states (S,) and of actions (S, A).
        """
        if self.decides:
            self._used.add(key)
        made = self._made.get(key)
        return made.plan if made is not None and made.reward is reward and made.beliefs is beliefs else None

    def make(
        self, key: str, requested: tuple[Array | None, OutcomeModel | None], reward: Array, beliefs: OutcomeModel
    ) -> tuple[Array, Array]:
        """Compute and store the plan `key` for a reward (S, A) and beliefs; return the values of states (S,) and of actions (S, A).

        `requested`: the two objects by which `made` finds the plan again. They are the reward and beliefs that the caller of
        `CuriousLearner.plan` gave, where None stands for the agent's own; `reward` and `beliefs` are the arrays and model that are used.
        """
        if self.relative:
            before = self._made.get(key)
            start = self._starts.get(key) if before is None else before.plan[0]
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance, start, relative=True, method="modified")
        else:
            plan = value_iteration(beliefs, reward, self.discount, self.tolerance)
        for values in plan:
            values.setflags(write=False)
        self._made[key] = _Made(*requested, plan)
        return plan

    def keep(self) -> None:
        """Process the end of a transition: discard the present plans, but keep their values as the start of the next plans.

        The values of a plan that no decision has requested are discarded too: a restarted learner repeats the decisions only, and must
        continue from the same values.
        """
        for key in self._used & self._made.keys():
            self._starts[key] = self._made[key].plan[0]
        self._made.clear()
        self._used.clear()

    def undo(self) -> None:
        """Discard the present plans, because the action for which they were made was interrupted.

        Their values are discarded too: the next plans start from the values that were last kept by `keep`.
        """
        self._made.clear()
        self._used.clear()


class CuriousLearner:
    """Learns from transitions and chooses actions. Its choices depend only on its settings and its transitions.

    It does not act; `CuriousAgent` adds a plant and a store.

    Args:
        space: states and actions of one part.
        settings: settings of the learner.

    Raises:
        UnknownName: there is no such explorer, or no such divergence (the measure for the reward of an observation).
        InvalidValue: a goal that the space does not have or that the explorer ignores, a goal weight without a goal, or a detector with
            `forgetting` below 1.
    """

    def __init__(self, space: Space, settings: CuriousSettings) -> None:
        self.space, self.part = space, space.part
        self.explorer, self._score = named("explorer", settings.explorer, EXPLORERS)
        self.seed, self.discount = settings.seed, settings.discount
        self.model = TransitionModel(space, settings.initial, settings.divergence, settings.forgetting, settings.detector)
        self.beliefs: OutcomeModel = self.model.debiased() if settings.beliefs == "debiased" else self.model
        """The outcome model with which plans are made."""
        self.transitions = 0
        """Number of transitions observed, with those that were read from a store."""
        self.last: Transition | None = None
        """The newest transition; None before the first."""
        self._settings, self._first_explorer = settings, self.explorer
        self._external = pursued(space, settings.goal, settings.goal_weight, self.explorer)
        self._plans = Plans(settings.discount, settings.tolerance, settings.relative)
        self._draws = Draws(space.part)

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the learner and its space, as JSON values.

        A store (the database of the transitions) can be continued only with equal settings.
        """
        record = vars(self._settings) | {
            "space": self.space.settings,
            "explorer": self._first_explorer,
            "divergence": self.model.divergence,
            "forgetting": self.model.forgetting,
            "goal": None if self._external is None else self._external.settings,
        }
        del record["goal_weight"]  # recorded with the goal
        if self._settings.detector == "none":  # as in records of earlier versions
            del record["detector"]
        return record

    def plan(self, reward: Array | None = None, beliefs: OutcomeModel | None = None, key: str = "curious") -> tuple[Array, Array]:
        """Return the values of states (S,) and of actions (S, A) of a plan (Algorithm 7). Between two transitions it is computed only once.

        `reward`: (S, A); None: the reward that the agent pursues, which is the information gain if it has no goal (see
        `External.combined`). `beliefs`: outcome model; None: that of the agent. `key`: name of the plan; each plan starts from the values
        of the previous plan of the same name, if the setting `relative` is True.
        """
        plan = self._plans.made(key, reward, beliefs)
        if plan is None:
            wanted = self._pursued() if reward is None else reward
            plan = self._plans.make(key, (reward, beliefs), wanted, self.beliefs if beliefs is None else beliefs)
        return plan

    def _explore_by(self, explorer: str | Explorer) -> None:
        """Choose actions by another explorer from now on; raises UnknownName, or InvalidValue if it ignores the learner's goal."""
        name, score = named("explorer", explorer, EXPLORERS)
        if self._external is not None:
            require_pursuing(name)
        self.explorer, self._score = name, score

    def _choose(self, state: int) -> int:
        draws = self._draws.at(self.seed, self.transitions)
        scores = self._scores(state, draws)
        if self.explorer not in EXPLORERS:
            scores = self._checked_scores(scores, state)
        return choose(scores, draws)

    def _scores(self, state: int, draws: np.random.Generator) -> Array:
        """Return the explorer's score of each action of a state; the plans that it requests count as used for a decision."""
        self._plans.decides = True
        try:
            return self._score(self, state, draws)
        finally:
            self._plans.decides = False

    def _checked_scores(self, given: Any, state: int) -> Array:
        """Return the scores that an explorer of the user gave; raises InvalidValue unless each action of the state has a number."""
        actions = len(self.space.actions(state))
        said = f"explorer {self.explorer!r} returned {given!r} in state {state}: give a score for each action, shape ({actions},)."
        try:
            scores = real_array("scores", given)
        except InvalidValue:
            raise InvalidValue(said) from None
        if scores.shape != (actions,) or np.isnan(scores).any():
            raise InvalidValue(said)
        return scores

    def _learn(self, transition: Transition) -> None:
        self.model.observe(transition.s, transition.a, transition.s_next)
        self._continue(transition)

    def _continue(self, transition: Transition) -> None:
        """Update the learner for a transition that the model has already observed."""
        self.transitions, self.last = transition.n, transition
        self._plans.keep()
        for watch in WATCHERS:
            watch(self, transition)

    def _replay(self, transitions: list[Transition], explorers: Mapping[int, str]) -> None:
        """Learn from recorded transitions; each decision is repeated, so that the next plan starts from the same values as before.

        `explorers`: by which decisions were made, from that number of transitions on.
        """
        for transition in transitions:
            if self.transitions in explorers:
                self._explore_by(explorers[self.transitions])
            self._scores(transition.s, self._draws.at(self.seed, self.transitions))
            self._learn(transition)
        for explorer in list(explorers.values())[-1:]:  # also if it was changed during an action that was never observed
            self._explore_by(explorer)

    def _pursued(self) -> Array:
        """Return the reward (S, A) with which plans are computed.

        Without a goal of the agent it is the model's (intrinsic) reward. With a goal it is the goal's (external) reward, alone or with
        a weight added to the model's (`combined`).
        """
        return self.model.reward if self._external is None else self._external.combined(self.model.reward)
