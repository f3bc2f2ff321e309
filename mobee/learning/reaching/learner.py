"""The reach learner without a plant: predictor, failures, plans, choices (thesis 8.1 to 8.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.learning.draws import Draws
from mobee.learning.explorers import choose
from mobee.learning.named import named
from mobee.learning.reaching.failures import failures_of, has_failed
from mobee.learning.reaching.planning import REACH, ReachPlanning
from mobee.learning.reaching.predictors import PREDICTORS, Reaches, RewardPredictor
from mobee.learning.reaching.strategies import STRATEGIES, StrategyOf
from mobee.learning.reaching.tries import Problems, Step, Try, made_of
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.reach import ReachTarget


class ReachLearner:
    """Learns from the steps of problem-tries and chooses the next; what it chooses follows from its settings and the steps so far.

    The settings, and what they raise, are those of `ReachAgent`.
    """

    def __init__(
        self,
        space: Space,
        reaches: Reaches,
        beliefs: OutcomeModel | None,
        predictor: str | RewardPredictor,
        strategy: str | StrategyOf,
        failures: str,
        discount: float,
        penalty: float,
        limit: int,
        seed: int,
        model: TransitionModel | None,
    ) -> None:
        if not (penalty < 0.0 and limit >= 1):
            raise InvalidValue(f"penalty={penalty!r}, limit={limit!r}: valid are a reward below 0, and at least 1 action a problem-try.")
        self.space, self.part, self.reaches, self.model = space, space.part, reaches, model
        self._strategy_name, make_strategy = named("strategy", strategy, STRATEGIES)
        self.predictor = named("predictor", predictor, PREDICTORS)[1](reaches) if isinstance(predictor, str) else predictor
        self.failures = failures_of(space, reaches, failures)
        """What is known of failed transitions."""
        self.problems = Problems()
        """What was reached for."""
        self.steps, self.tries = 0, 0
        """How many actions and how many problem-tries have ended, those of the store included."""
        self.last: Try | None = None
        """The newest problem-try that ended."""
        if beliefs is None:
            beliefs = (TransitionModel(space) if model is None else model).debiased()
        self.planning = ReachPlanning(space, beliefs, discount)
        self.discount, self.penalty, self.limit, self.seed = discount, penalty, limit, seed
        self._strategy, self._failures_kind = make_strategy(reaches, self.predictor), failures
        self._draws, self._draws_of_try, self._draws_of_problem = (
            Draws(f"{space.part} {what}") for what in ("reaching", "problem-try", "problem")
        )
        self._problem: int | None = None  # of the problem-try under way
        self._made: list[Step] = []  # in it
        self._worth: Array | None = None  # of the reaches, in it
        self._plan: tuple[Array, Array] | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """All that decides what it does but for its space and its beliefs, as plain JSON values."""
        return {
            "predictor": self.predictor.settings,
            "strategy": self._strategy_name,
            "failures": self._failures_kind,
            "discount": self.discount,
            "penalty": self.penalty,
            "limit": self.limit,
            "seed": self.seed,
            "learns the model": self.model is not None,
        }

    @property
    def under_way(self) -> int | None:
        """The problem of the problem-try that has not ended, None between two."""
        return self._problem

    def begin(self, target: ReachTarget) -> None:
        """Start a problem-try, or go on with the one under way if it is at this place; one at another place ends as it is."""
        problem = self.problems.index(target)
        if problem != self._problem:
            self._end()
            self._problem = problem

    def planned(self) -> tuple[Array, Array]:
        """V (S,) and Q (S, A + 1) of the plan of the problem-try under way, see `ReachPlanning.values`; InvalidValue between two."""
        if self._plan is None:
            if self._worth is None:
                self._worth = self._strategy.rewards(self._target, self._draws_of_try.at(self.seed, self.tries))
            self._plan = self.planning.values(self._worth, self.failures.rewards(self._target))
        return self._plan

    def decide(self, state: int) -> int:
        """The action to take in a state, or REACH."""
        chosen = choose(self.planned()[1][state], self._draws.at(self.seed, self.steps))
        return REACH if chosen == self.space.goals.shape[1] else chosen

    def failed(self, state: int, following: int) -> bool:
        """Whether a transition did not climb the values of the plan under way."""
        return has_failed(self.planned()[0], state, following)

    def expected(self, state: int) -> float:
        """The reward expected of reaching from a state, for the target of the problem-try."""
        return float(self.predictor.mean(self._target)[state])

    def observe(self, step: Step) -> None:
        """Take in a step of the problem-try under way."""
        self._made.append(step)
        self.steps = step.n
        if step.a == REACH:
            self.predictor.add(step.s, self._target, step.reward, step.expected)
            self._strategy.add(step.s, self._target, step.reward, step.expected)
        else:
            self._observe_transition(step)
        if step.a == REACH or len(self._made) >= self.limit:
            self._end()

    def replay(self, targets: list[ReachTarget], steps: list[Step]) -> None:
        """Take in what is on record; the plans of a problem-try that has not ended are made anew, as it needs them to go on."""
        for target in targets:
            self.problems.index(target)
        last = [step for step in steps if step.number == steps[-1].number]
        under_way = last if last and last[-1].a != REACH and len(last) < self.limit else []
        for step in steps:
            if step.number != self.tries + 1 or step.problem != self._problem:
                self._end()
                self.begin(targets[step.problem])
            if under_way and step.number == under_way[0].number:
                self.planned()
            self.observe(step)

    def problem_draws(self) -> np.random.Generator:
        """Random numbers for the choice of the next problem."""
        return self._draws_of_problem.at(self.seed, self.tries)

    @property
    def _target(self) -> Array:
        if self._problem is None:
            raise InvalidValue("no problem-try is under way: begin one first.")
        return self.problems.targets[self._problem].position

    def _observe_transition(self, step: Step) -> None:
        """In simultaneous learning a failure without contact with the world is the model's, not the problem's (thesis 9.4.1)."""
        if self.model is None or step.touched or not step.failed:
            self.failures.add(step.s, step.a, self._target, step.reward)
        if self.model is not None and not step.touched:
            self.model.observe(step.s, step.a, step.s_next)
            self.planning.refresh()
        if step.failed:
            self._plan = None

    def _end(self) -> None:
        if self._problem is not None and self._made:
            self.problems.tries[self._problem] += 1
            self.tries += 1
            self.last = made_of(self._made)
        self._problem, self._made, self._worth, self._plan = None, [], None, None


@dataclass(frozen=True, slots=True)
class ReachPlan:
    """A way to a state and the reach from there.

    `path`: states from start to the pre-reach state.  `actions`: what to do in each but the last.  `probabilities`: that each ends
    where the path says; `success`: that all of them do.  `state`: from which to reach.  `expected`: the reward then (thesis eq. 8.4).
    `avoided`: transitions, as (state, goal), that the way would consist of but for failures remembered.
    """

    path: tuple[int, ...]
    actions: tuple[int, ...]
    probabilities: tuple[float, ...]
    success: float
    state: int
    expected: float
    avoided: tuple[tuple[int, int], ...]


def way_to_reach(learner: ReachLearner, target: ReachTarget, start: int) -> ReachPlan:
    """The way on which a learner expects most, from a state; raises InvalidValue if the space has no such state."""
    learner.space.actions(start)
    expected = np.maximum(learner.predictor.mean(target.position), 0.0)  # no reward is below 0, and the plan would put off one that is
    failures = learner.failures.rewards(target.position)
    path, actions, probabilities = _walk(learner, start, *learner.planning.values(expected, failures))
    freely, chosen, _ = _walk(learner, start, *learner.planning.values(expected, 0.0))
    taken = set(zip(path, actions, strict=False))
    avoided = [(s, a) for s, a in zip(freely, chosen, strict=False) if failures[s, a] < 0.0 and (s, a) not in taken]
    return ReachPlan(
        path=tuple(path),
        actions=tuple(actions),
        probabilities=tuple(probabilities),
        success=float(np.prod(probabilities)),
        state=path[-1],
        expected=float(expected[path[-1]]),
        avoided=tuple((s, learner.space.goal(s, a)) for s, a in avoided),
    )


def _walk(learner: ReachLearner, start: int, values: Array, action_values: Array) -> tuple[list[int], list[int], list[float]]:
    """Follow the best actions through their likeliest outcomes that are worth more, until reaching is best."""
    path, actions, chances = [start], list[int](), list[float]()
    best = action_values.argmax(axis=1)
    while best[path[-1]] != action_values.shape[1] - 1:
        here, action = path[-1], int(best[path[-1]])
        outcomes, probabilities = learner.planning.outcomes[here, action], learner.planning.probabilities[here, action]
        nearer = np.where(values[outcomes] > values[here], probabilities, 0.0)
        if not nearer.any():
            break  # nothing is worth going for
        likeliest = int(nearer.argmax())
        path.append(int(outcomes[likeliest]))
        actions.append(action)
        chances.append(float(probabilities[likeliest]))
    return path, actions, chances
