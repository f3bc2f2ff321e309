# SPDX-License-Identifier: Apache-2.0
"""The reach learner: it predicts rewards, remembers failures, plans, and chooses actions, but moves no robot (thesis 8.1 to 8.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np

from mobee.arrays import Array, real_array
from mobee.errors import InvalidValue
from mobee.learning.explorers import Draws, choose
from mobee.learning.reaching.changes import DETECTORS, NONE, DetectorOf, WorldChanges
from mobee.learning.reaching.failures import AlikeFailures, Failures, FailuresSinceChange, failures_of, has_failed
from mobee.learning.reaching.predictors import PREDICTORS, PredictorOf, Reaches, RewardPredictor
from mobee.learning.reaching.reaches import REACH, SCALE, ReachPlanning
from mobee.learning.reaching.store import Problems, Step, Try, made_of
from mobee.learning.reaching.strategies import STRATEGIES, Strategy, StrategyOf
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import ReachTarget, checked_target
from mobee.settings import Range, Settings, named


@dataclass(frozen=True, kw_only=True)
class ReachSettings(Settings):
    """Settings of a `ReachAgent`.

    Args:
        predictor: predicts rewards of reaches: a name in `predictors.PREDICTORS` ("weighted" is that of the thesis), a class or function
            that makes a predictor from the `Reaches`, the text `module:name` of such a class or function, or a `RewardPredictor` that has
            learned nothing yet.
        strategy: computes the rewards of reaches in the agent's plans while it learns: a name in `strategies.STRATEGIES` ("intrinsic",
            "greedy" and "random" are those of the thesis), a class or function that makes a strategy, see `strategies.StrategyOf`, or the
            text `module:name` of such a function.
        failures: the targets for which plans avoid a transition after it has failed: "spread": all targets, but less for distant ones, as
            published; "local": targets within 25 mm; "alike": the target with which it failed. With "alike", plans also avoid each
            transition that was not tried with the present target, if similar transitions failed more often than the average of all
            transitions.
        detector: detects changes of the world. After a change, failed transitions are avoided for all targets, see `FailuresSinceChange`. A
            name in `changes.DETECTORS`, a class or function that makes a detector, see `changes.DetectorOf`, or the text `module:name` of
            such a function.
        discount: factor of future rewards in plans.
        scale: unit of the distances in thesis eqs. 8.1, 8.4, 8.5 and 8.7, m.
        penalty: reward of a failed transition, below 0.
        limit: number of actions after which a problem-try (one attempt to reach a target) ends, the reach included.
        seed: seed of all random choices; with the same seed, agents of different parts choose differently.
    """

    predictor: str | RewardPredictor | PredictorOf = "weighted"
    strategy: str | StrategyOf = "intrinsic"
    failures: Literal["spread", "local", "alike"] = "spread"
    detector: str | DetectorOf = NONE
    discount: Annotated[float, Range(ge=0, lt=1)] = 0.9
    scale: Annotated[float, Range(gt=0)] = SCALE
    penalty: Annotated[float, Range(lt=0)] = -10.0
    limit: Annotated[int, Range(ge=1)] = 10
    seed: Annotated[int, Range(ge=0)] = 0


class ReachLearner:
    """Learns from the steps of problem-tries and chooses the next action. Its choices depend only on its settings and its steps.

    A problem-try is one attempt to reach a target: transitions to a state, then a reach. The learner does not act; `ReachAgent` adds a
    plant and a store.

    Args:
        space: states and transitions of the part.
        reaches: the marker's position in each state, and the unit of distances.
        settings: settings of the learner.
        beliefs: outcome probabilities of the transitions, from which plans are computed; None: those of `model`, from its method
            `debiased`. If `model` is None too: every action most probably ends in its goal.
        model: transition model that is learned at the same time; None: none.

    Raises:
        UnknownName: no such predictor, strategy, detector or kind of failures.
        InvalidValue: beliefs or a model of another space.
    """

    def __init__(
        self,
        space: Space,
        reaches: Reaches,
        settings: ReachSettings,
        beliefs: OutcomeModel | None = None,
        model: TransitionModel | None = None,
    ) -> None:
        self.space, self.part, self.reaches, self.model = space, space.part, reaches, model
        self._strategy_name, make_strategy = named("strategy", settings.strategy, STRATEGIES)
        self.predictor = made_predictor(settings.predictor, reaches)
        self.failures: Failures | AlikeFailures | FailuresSinceChange = failures_of(space, reaches, settings.failures)
        """The memory of failures, which gives negative rewards to transitions."""
        self.problems = Problems()
        """The targets that were tried, with their numbers."""
        self.steps, self.tries = 0, 0
        """Number of actions and of problem-tries that have ended, those of the store included."""
        self.last: Try | None = None
        """The newest problem-try that ended."""
        if model is not None and model.space is not space and model.space.settings != space.settings:
            raise InvalidValue(f"the model learns {model.space}, the agent acts in {space}: make both with one space.")
        if beliefs is None:
            beliefs = (TransitionModel(space) if model is None else model).debiased()
        self.planning = ReachPlanning(space, beliefs, settings.discount)
        self.changes: WorldChanges | None = None
        """Detects changes of the world; None if there is no detector."""
        self._detector_name = NONE
        if settings.detector != NONE:
            self._detector_name, make_detector = named("detector", settings.detector, DETECTORS)
            assert make_detector is not None  # only NONE has none
            self.failures = FailuresSinceChange(space, reaches, self.failures)
            self.changes = WorldChanges(make_detector, self.planning, self.predictor, self.failures)
        self.discount, self.penalty, self.limit, self.seed = settings.discount, settings.penalty, settings.limit, settings.seed
        self._strategy, self._failures_kind = make_strategy(reaches, self.predictor), settings.failures
        if not isinstance(self._strategy, Strategy):
            raise InvalidValue(
                f"strategy {self._strategy_name!r} made {self._strategy!r}: it needs the methods rewards and add (Strategy)."
            )
        self._draws, self._draws_of_try, self._draws_of_problem = (
            Draws(f"{space.part} {purpose}") for purpose in ("reaching", "problem-try", "problem")
        )
        self._problem: int | None = None  # of the problem-try under way
        self._made: list[Step] = []  # steps of the problem-try under way
        self._worth: Array | None = None  # (S,) rewards of the reaches in it
        self._plan: tuple[Array, Array] | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the learner as JSON values, without its space and the outcome probabilities from which it plans."""
        return {
            "predictor": self.predictor.settings,
            "strategy": self._strategy_name,
            "failures": self._failures_kind,
            "discount": self.discount,
            "penalty": self.penalty,
            "limit": self.limit,
            "seed": self.seed,
            "learns the model": self.model is not None,
        } | ({} if self.changes is None else {"detector": self._detector_name})

    @property
    def under_way(self) -> int | None:
        """The index of the target of the present attempt, in `problems.targets` (the targets tried so far); None if there is none."""
        return self._problem

    def begin(self, target: ReachTarget) -> None:
        """Start a problem-try (attempt to reach one target), or continue the present one if its target is at the same position.

        If the present problem-try has a target at another position, it is ended first. Raises InvalidValue if the target is no
        `ReachTarget`.
        """
        problem = self.problems.index(checked_target(target))
        if problem != self._problem:
            self.end_try()
            self._problem = problem

    def planned(self) -> tuple[Array, Array]:
        """Return the values of states V (S,) and of actions Q (S, A + 1) in the plan of the present problem-try.

        A problem-try is one attempt to reach one target. The last column of Q is the reach. Raises InvalidValue without a problem-try.
        """
        if self._plan is None:
            if self._worth is None:
                self._worth = self._checked_rewards(self._strategy.rewards(self._target, self._draws_of_try.at(self.seed, self.tries)))
            self._plan = self.planning.values(self._worth, self.failures.rewards(self._target, float(self._worth.max())))
        return self._plan

    def _checked_rewards(self, given: Any) -> Array:
        """Return the rewards that the strategy gave; raises InvalidValue unless they are a number for each state, -inf for no reach."""
        rewards = real_array(f"the rewards of the strategy {self._strategy_name!r}", given)
        wrong = int((~(rewards < np.inf)).sum())
        if rewards.shape != (len(self.space),) or wrong or not (rewards > -np.inf).any():
            given = f"{wrong} of which are NaN or infinite" if wrong else "none of which is finite"
            about = f"of shape {rewards.shape}" if rewards.shape != (len(self.space),) else given
            raise InvalidValue(
                f"strategy {self._strategy_name!r} returned rewards {about}: give one for each state, "
                f"shape ({len(self.space)},), finite, or -inf where no reach is allowed."
            )
        return rewards

    def decide(self, state: int) -> int:
        """Choose the action to take in a state: the number of a transition, or REACH (-1) to reach for the target.

        Raises InvalidValue if no problem-try (attempt to reach one target) is under way.
        """
        chosen = choose(self.planned()[1][state], self._draws.at(self.seed, self.steps))
        return REACH if chosen == self.space.goals.shape[1] else chosen

    def failed(self, state: int, following: int) -> bool:
        """Return whether a transition failed: the state `following`, in which it ended, has no higher value than its start `state`.

        The values are those of the plan of the present problem-try (attempt to reach one target).
        """
        return has_failed(self.planned()[0], state, following)

    def expected(self, state: int) -> float:
        """Return the expected reward of a reach from a state for the target that the agent tries to reach now.

        Raises InvalidValue if no problem-try (attempt to reach one target) is under way.
        """
        return float(self.predictor.mean(self._target)[state])

    def observe(self, step: Step) -> None:
        """Learn from a step of the present problem-try (attempt to reach one target).

        The problem-try ends with this step if the step is a reach, or if the problem-try has `limit` steps now.
        """
        self._made.append(step)
        self.steps = step.n
        expected = None if self.changes is None else self.changes.probabilities(step, self._target, self._goal(step))
        if step.a == REACH:
            self.predictor.add(step.s, self._target, step.reward, step.expected)
            self._strategy.add(step.s, self._target, step.reward, step.expected)
        else:
            self._observe_transition(step)
        if self.changes is not None and expected is not None and self.changes.observe(step, self._target, expected):
            self._plan = None
        if step.a == REACH or len(self._made) >= self.limit:
            self.end_try()

    def replay(self, targets: list[ReachTarget], steps: list[Step]) -> None:
        """Learn from recorded steps, in their order.

        `targets`: the recorded targets; `Step.problem` is an index of this list. `steps`: all recorded steps. If the last problem-try
        (attempt to reach a target) has not ended, its plans are computed again, so that the learner can continue it.
        """
        for target in targets:
            self.problems.index(target)
        last = [step for step in steps if step.number == steps[-1].number]
        under_way = last if last and last[-1].a != REACH and len(last) < self.limit else []
        for step in steps:
            if step.number != self.tries + 1 or step.problem != self._problem:
                self.end_try()
                self.begin(targets[step.problem])
            if under_way and step.number == under_way[0].number:
                self.planned()
            self.observe(step)

    def problem_draws(self) -> np.random.Generator:
        """Return the random generator for the choice of the target of the next problem-try (one attempt to reach a target).

        Its numbers depend only on the learner's part and seed, and on the number of problem-tries that have ended. Use it only until the
        next call of this method, which returns the same object in another state.
        """
        return self._draws_of_problem.at(self.seed, self.tries)

    @property
    def _target(self) -> Array:
        if self._problem is None:
            raise InvalidValue("no problem-try is under way: begin one first.")
        return self.problems.targets[self._problem].position

    def _goal(self, step: Step) -> int:
        """Return the state that the action of a step should lead to: the goal of a transition; for a reach, the state where it begins."""
        return step.s if step.a == REACH else self.space.goal(step.s, step.a)

    def _observe_transition(self, step: Step) -> None:
        """Learn from a transition; with a model, a failure without contact is attributed to the model, not to the target (thesis 9.4.1)."""
        if self.model is None or self.changes is not None or step.touched or not step.failed:
            self.failures.add(step.s, step.a, self._target, step.reward, step.touched)
        if self.model is not None and not step.touched:
            self.model.observe(step.s, step.a, step.s_next)
            self.planning.refresh()
        if step.failed:
            self._plan = None

    def end_try(self) -> None:
        """End the present problem-try (attempt to reach one target), if there is one.

        It is included in `tries`, and stored in `last`, only if at least one action was made in it.
        """
        if self._problem is not None and self._made:
            self.problems.tries[self._problem] += 1
            self.tries += 1
            self.last = made_of(self._made)
        self._problem, self._made, self._worth, self._plan = None, [], None, None


def made_predictor(given: str | RewardPredictor | PredictorOf, reaches: Reaches) -> RewardPredictor:
    """Return the predictor of rewards that `given` specifies.

    `given`: a predictor, which is returned unchanged; a class or function, which is called with `reaches` to make the predictor; the name
    of a class in `predictors.PREDICTORS`; or the text `module:name` of a class or function. Raises UnknownName for an unknown name,
    InvalidValue if what is made is no predictor.
    """
    if isinstance(given, str | type) or not isinstance(given, RewardPredictor):
        make: PredictorOf
        name, make = named("predictor", given, PREDICTORS)
        made = make(reaches)
        if not isinstance(made, RewardPredictor):
            raise InvalidValue(f"predictor {name!r} made {made!r}: it needs add, mean, deviation, sample and settings (RewardPredictor).")
        return made
    return given
