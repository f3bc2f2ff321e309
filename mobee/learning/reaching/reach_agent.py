# SPDX-License-Identifier: Apache-2.0
"""The reach agent, and its evaluation. For each target it learns from which state to reach, and a path there (thesis chapter 8).

An evaluation measures what the agent has learned, and does not change the agent (thesis 8.3.3).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mobee.arrays import Array, Ints, checked_count
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.learning.explorers import choose
from mobee.learning.object_space import ObjectSpace
from mobee.learning.reaching.failures import has_failed
from mobee.learning.reaching.learner import ReachLearner, ReachSettings
from mobee.learning.reaching.predictors.predictor import begin_world
from mobee.learning.reaching.reaches import REACH, Reaches, ReachPlan, plan_reach, reaches_of
from mobee.learning.reaching.store import ReachStore, Step, Try
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome, Plant
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget, checked_target, reward_of
from mobee.settings import accepts

NO_STATE = -1  # instead of a state, where no reach was made


class ReachAgent(ReachLearner):
    """Learns to bring a marker of one part to targets. Each position of a target is a problem.

    One attempt at a problem is a problem-try: move by a plan to a state, then reach for the target. The reward of a reach also informs
    about other targets. There may be any number of targets. Decisions depend only on the settings and the steps of the agent, so an agent
    that is restarted with its store continues as if it had never stopped.

    Args:
        space: states and transitions of the part.
        plant: the robot on which the agent acts; it must have the motors of the space's robot.
        beliefs: outcome probabilities of the transitions, from which plans are computed, e.g. `load_learned(file).model.debiased()`. None:
            those of `model`; if `model` is None too: every action most probably ends in its goal.
        marker: the marker that must reach the targets.
        settings: settings of the agent; None: the defaults.
        store: file to which steps are written, and from which they are read at the start; None: they are not stored.
        model: transition model that is learned at the same time (thesis 9.4.1), from transitions without contact with the world; None:
            none.
        hands: (S, 3) m, root frame, position of the marker in each state; None: computed by kinematics, with the other parts at home.
        jacobians: (S, 3, d) m/rad, derivatives of `hands` with respect to the joints of the space; None: computed, or unknown if `hands`
            are given.
        **changes: fields of `ReachSettings` by keyword, in place of the values in `settings`.

    Raises:
        UnknownName: no such setting, predictor, strategy, value of the setting `failures`, detector, or marker.
        InvalidValue: a plant of another robot, an `ObjectSpace`, or a value out of range.
        MobeeError: the store holds reaches of another space or marker, or with another `scale` (unit of distances, `ReachSettings`).
    """

    @accepts(ReachSettings)
    def __init__(
        self,
        space: Space,
        plant: ReachPlant,
        beliefs: OutcomeModel | None = None,
        *,
        marker: str,
        settings: ReachSettings | None = None,
        store: ReachStore | None = None,
        model: TransitionModel | None = None,
        hands: Array | None = None,
        jacobians: Array | None = None,
        **changes: Any,
    ) -> None:
        _require_robot(space, plant)
        if isinstance(space, ObjectSpace):
            raise InvalidValue(f"{space}: a reach agent does not perceive objects. Give it the postures alone, `space.postures`.")
        chosen = ReachSettings.made(settings, changes)
        scale = chosen.scale
        reaches = reaches_of(space, marker, scale) if hands is None else Reaches(space.samples, hands, scale, jacobians)
        super().__init__(space, reaches, chosen, beliefs, model)
        self.plant, self.marker, self.store = plant, marker, store
        self._state: int | None = None
        self._is_behind = False  # a write was begun, and what it wrote was not learned
        if store is not None:
            store.bind({"space": space.settings, "marker": marker, "scale": scale})
            store.learner(self.settings)
            self.replay(store.problems(), store.load())

    @property
    def state(self) -> int:
        """The present state of the part, from the last outcome.

        At the start, and after an interruption or an evaluation, the state is not known; reading this property then lets the plant measure
        it.
        """
        if self._state is None:
            self._state = self.space.state_of(self.plant.measure(self.part))
        return self._state

    def begin(self, target: ReachTarget) -> None:
        """Start a problem-try, or continue it, as `ReachLearner.begin`; first learn a step whose write was interrupted."""
        self._catch_up()
        super().begin(target)

    def try_problem(self, target: ReachTarget) -> Try:
        """Make one problem-try (attempt to reach one target) and return it: move to a state by a plan, then reach (thesis 8.3.1).

        The agent presents the target to the plant, plans again after failed transitions, and learns from every step. Raises
        ActionInterrupted if the plant does; the problem-try then stays under way, and the next call for a target at the same position
        continues it.
        """
        self.begin(target)
        self.plant.present(target)
        while self.under_way is not None:
            self.step()
        assert self.last is not None
        return self.last

    def learn(self, problems: Sequence[ReachTarget], tries: int) -> None:
        """Make `tries` more attempts to reach a target (problem-tries), each for the problem with the fewest tries (thesis 8.3.2).

        A problem is one target. If several problems have the fewest tries, a random one of them is chosen. A problem-try under way is
        continued first. If an action is interrupted, the agent chooses the next action of the same problem-try. Raises InvalidValue if a
        problem is no `ReachTarget`, or `tries` is no whole number of at least 0.
        """
        tries, problems = checked_count("tries", tries), _checked_problems(problems)
        self._catch_up()
        end = self.tries + tries
        while self.tries < end:
            target = self.problems.targets[self.under_way] if self.under_way is not None else None
            try:
                self.try_problem(self.problems.least_tried(problems, self.problem_draws()) if target is None else target)
            except ActionInterrupted:
                continue

    def practise(self, plant: ReachPlant, problems: Sequence[ReachTarget], tries: int) -> None:
        """Learn from problem-tries on another plant, for example a simulated robot in the world as it is perceived now.

        A problem-try is one attempt to reach one target. After the robot has perceived a change of the world, such as a new object,
        practice reduces the number of tries on the robot. If the agent has a detector of changes, the agent assumes that the world changed
        just before the first of these tries. The predictor "gp" estimates how similar the robot's later rewards are to those on the other
        plant and to those before the change. Less similar rewards have less influence on its predictions. A problem-try under way is ended
        first. The attributes `tries` and `steps` include the tries and actions on both plants. `plant`: moves the space's robot.
        `problems`, `tries`: as in `learn`.

        Raises InvalidValue for a plant of another robot, or if the agent has a store, which holds what happened to one robot only.
        """
        _require_robot(self.space, plant)
        if self.store is not None:
            raise InvalidValue("an agent with a store cannot practise: the store holds the steps of one robot only. Make it without store.")
        self.end_try()
        if self.changes is None:
            begin_world(self.predictor)
        else:
            self.changes.report()
        own = self.plant
        self.plant, self._state = plant, None
        try:
            self.learn(problems, tries)
        finally:
            self.plant, self._state = own, None
            begin_world(self.predictor)
            if self.changes is not None:
                self.changes.restart()  # differences between the two plants are no change of the world

    def plan(self, target: ReachTarget, state: int | None = None) -> ReachPlan:
        """Plan a reach for a target from a state (None: from the present one), without moving or learning."""
        expected = np.maximum(self.predictor.mean(target.position), 0.0)
        start = self.state if state is None else state
        return plan_reach(self.space, self.planning, expected, self.failures.rewards(target.position, float(expected.max())), start)

    def evaluate(self, problems: Sequence[ReachTarget], repetitions: int = 1) -> Evaluation:
        """Try every problem in each repetition with what was learned so far, and return the results (thesis 8.3.3).

        The robot moves, but the agent does not learn. Raises InvalidValue if a problem is no `ReachTarget`, or `repetitions` is no whole
        number of at least 0.
        """
        try:
            return evaluate(self, problems, repetitions)
        finally:
            self._state = None

    def step(self) -> Step:
        """Perform one action of the present problem-try (attempt to reach one target), learn from it, and return it.

        Before, `begin` must start the problem-try, and the plant's method `present` must be called with its target, as `try_problem` does.
        With a store the step is on disk when this returns. After an interrupt (Ctrl-C) during the write, the next call learns the step
        first if it is on disk. Raises ActionInterrupted if the plant interrupts the action, and InvalidValue if no problem-try is under
        way.
        """
        self._catch_up()
        state = self.state
        action = self.decide(state)
        self._state = None  # unknown if the action is interrupted, or its record fails
        step = self._reached(state) if action == REACH else self._moved(state, action)
        if self.store is not None:
            self._is_behind = True
            self.store.append(step, self.problems.targets)
        self.observe(step)
        self._is_behind = False
        self._state = step.s_next
        return step

    def _catch_up(self) -> None:
        """Learn the steps that are on disk and were not learned, because their write was interrupted."""
        if self._is_behind and self.store is not None:
            for step in self.store.after(self.steps):
                self.observe(step)
        self._is_behind = False

    def _moved(self, state: int, action: int) -> Step:
        """Make a transition; a failure costs the penalty."""
        outcome, following = move(self.plant, self.space, state, action)
        failed = self.failed(state, following)
        return self._step(outcome, state, action, following, failed=failed, reward=self.penalty if failed else 0.0)

    def _reached(self, state: int) -> Step:
        """Reach for the target from a state; return the step with its reward and remaining error."""
        expected = self.expected(state)
        outcome, following = reach(self.plant, self.space, self.marker)
        reward = reward_of(outcome.missing, self.reaches.scale)
        return self._step(outcome, state, REACH, following, reward=reward, expected=expected, missing=outcome.missing)

    def _step(
        self, outcome: Outcome | ReachOutcome, state: int, action: int, following: int, *, failed: bool = False, **rewards: float
    ) -> Step:
        """Return the next step of the problem-try; `rewards`: reward, and of a reach the expected reward and the remaining error [m]."""
        assert self.under_way is not None
        return Step(
            n=self.steps + 1,
            number=self.tries + 1,
            problem=self.under_way,
            s=state,
            a=action,
            s_next=following,
            failed=failed,
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(outcome.q.tolist()),
            touched=outcome.touched,
            **{"expected": 0.0, "missing": 0.0} | rewards,
        )


def evaluate(agent: ReachAgent, problems: Sequence[ReachTarget], repetitions: int) -> Evaluation:
    """Let an agent attempt to reach every target (problem) once in each repetition, in random order; return the results.

    Before each repetition the part moves towards a random state, with at most `agent.limit` actions. Each further attempt starts in the
    state in which the previous one ended. The agent does not learn from this: which transitions fail is recorded in a copy of
    `agent.failures`, and the copy is discarded at the end of the repetition.
    """
    problems = _checked_problems(problems)
    shape = checked_count("repetitions", repetitions), len(problems)
    found = Evaluation(
        np.zeros(shape),
        np.full(shape, NO_STATE),
        np.full(shape, np.nan),
        np.zeros(shape, np.intp),
        np.zeros(shape, np.intp),
        np.zeros(shape),
    )
    for repetition in range(repetitions):
        rng = np.random.default_rng([agent.seed, agent.tries, repetition])
        trial = _Trial(agent, rng)
        trial.go_to(int(rng.integers(len(agent.space))))
        for problem in rng.permutation(len(problems)).tolist():
            trial.reach_for(problems[problem], found, (repetition, problem))
    return found


@dataclass(frozen=True, slots=True, eq=False)
class Evaluation:
    """The results of an evaluation: arrays (R, P) for R repetitions of P problems (targets to reach).

    `rewards`: reward of the reach; 0 if no reach was made. `states`: state from which the reach started; -1 without a reach. `missing`: m,
    remaining distance after the reach; NaN without a reach. `failures`: number of failed transitions; a transition has failed if it leads
    to a state with no higher value in the plan. `actions`: number of transitions, plus 1 if a reach was made. `duration`: s, by the plant's
    clock.
    """

    rewards: Array
    states: Ints
    missing: Array
    failures: Ints
    actions: Ints
    duration: Array

    @property
    def scores(self) -> Array:
        """The sum of the rewards of all problems in each repetition, shape (R,), as in thesis figure 8.2."""
        total: Array = self.rewards.sum(axis=1)
        return total


def move(plant: Plant, space: Space, state: int, action: int) -> tuple[Outcome, int]:
    """Perform an action of a state on the plant; return its outcome and the state in which it ended."""
    outcome = plant.act(space.part, space.target(space.goal(state, action)))
    return outcome, space.state_of(outcome.q)


def reach(plant: ReachPlant, space: Space, marker: str) -> tuple[ReachOutcome, int]:
    """Reach with a marker for the target that the plant presents; return the outcome, and the state in which the part then rests."""
    outcome = plant.reach(space.part, marker)
    return outcome, space.state_of(outcome.after.q)


class _Trial:
    """One repetition, with the state of the part and the transitions that failed in it."""

    def __init__(self, agent: ReachAgent, rng: np.random.Generator) -> None:
        self.agent, self.rng, self.failures = agent, rng, agent.failures.copy()
        self.state = agent.space.state_of(agent.plant.measure(agent.part))

    def go_to(self, goal: int) -> None:
        """Go to a state without a presented target, or as far as the limit of actions allows."""
        agent = self.agent
        agent.plant.present(None)
        arrived = np.full(len(agent.space), -np.inf)
        arrived[goal] = 1.0
        _, action_values = agent.planning.values(arrived, 0.0)
        for _ in range(agent.limit):
            if self.state == goal:
                return
            action = choose(action_values[self.state], self.rng)
            _, self.state = move(agent.plant, agent.space, self.state, action)

    def reach_for(self, target: ReachTarget, found: Evaluation, at: tuple[int, int]) -> None:
        """Make one problem-try (attempt to reach a target): move by a plan, then reach; nothing is learned about rewards.

        The results are written to the arrays of `found`, at the indices `at`: (repetition, problem).
        """
        agent, position = self.agent, target.position
        agent.plant.present(target)
        expected = np.maximum(agent.predictor.mean(position), 0.0)
        values, action_values = agent.planning.values(expected, self.failures.rewards(position, float(expected.max())))
        for _ in range(agent.limit):
            found.actions[at] += 1
            action = choose(action_values[self.state], self.rng)
            if action == agent.space.goals.shape[1]:
                reached, following = reach(agent.plant, agent.space, agent.marker)
                found.rewards[at], found.states[at] = reward_of(reached.missing, agent.reaches.scale), self.state
                found.missing[at] = reached.missing
                found.duration[at] += reached.duration
                self.state = following
                return
            outcome, following = move(agent.plant, agent.space, self.state, action)
            found.duration[at] += outcome.duration
            failed = has_failed(values, self.state, following)
            self.failures.add(self.state, action, position, agent.penalty if failed else 0.0, outcome.touched)
            self.state = following
            if failed:
                found.failures[at] += 1
                values, action_values = agent.planning.values(expected, self.failures.rewards(position, float(expected.max())))


def _checked_problems(given: Sequence[ReachTarget]) -> list[ReachTarget]:
    if isinstance(given, ReachTarget):
        raise InvalidValue("problems is one ReachTarget: give a list of targets, as [target].")
    return [checked_target(one) for one in given]


def _require_robot(space: Space, plant: ReachPlant) -> None:
    """Raise InvalidValue if the plant does not move the robot of the space."""
    if plant.robot.motors != space.robot.motors:
        raise InvalidValue(f"the plant moves {plant.robot.name!r}, the space is of {space.robot.name!r}: make both from one robot.")
