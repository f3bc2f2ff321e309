"""The agent that learns from which pose each target is best reached, and a path there (thesis chapter 8)."""

from __future__ import annotations

from collections.abc import Sequence

from mobee.arrays import Array
from mobee.errors import ActionInterrupted, InvalidValue
from mobee.learning.reaching.evaluation import Evaluation, evaluate, move, reach
from mobee.learning.reaching.learner import ReachLearner, ReachPlan, way_to_reach
from mobee.learning.reaching.planning import REACH
from mobee.learning.reaching.predictors import Reaches, RewardPredictor
from mobee.learning.reaching.predictors.predictor import SCALE
from mobee.learning.reaching.store import ReachStore
from mobee.learning.reaching.strategies import StrategyOf
from mobee.learning.reaching.tries import Step, Try
from mobee.learning.reaching.where import reaches_of
from mobee.learning.space import Space
from mobee.learning.transitions import TransitionModel
from mobee.learning.value_iteration import OutcomeModel
from mobee.plant import Outcome
from mobee.reach import ReachOutcome, ReachPlant, ReachTarget, reward_of


class ReachAgent(ReachLearner):
    """Learns to put a marker of one part on targets: each place is a problem, and every problem-try tells something of all others.

    All it knows follows from its settings and its steps so far; with a store, an agent that is started again on it goes on as
    if it had never stopped.  Targets may be any number: new ones are new problems.

    Args:
        space: states and transitions of the part.
        plant: through which it acts; its robot must be the space's.
        beliefs: where transitions lead, e.g. `load_learned(file).model.debiased()`.  None: as `model` says, else mostly to the goal.
        marker: what is to come to the targets.
        predictor: of rewards, a name in `predictors.PREDICTORS` ("weighted" is the thesis'), `module:name` of what makes your own, or
            an object that has seen nothing yet.
        strategy: what it pursues while it learns, a name in `strategies.STRATEGIES` ("intrinsic", "greedy" and "random" are the thesis'),
            or what makes your own, see `StrategyOf`: a class, or its `module:name`.
        failures: how failed transitions are remembered, "spread" over all targets as published, "local", or as a hint to others "alike".
        discount: of future rewards in the plan.
        scale: m, the unit of distances in thesis eqs. 8.1, 8.4, 8.5 and 8.7.
        penalty: the reward of a failed transition.
        limit: actions after which a problem-try ends, the reach included.
        seed: decides ties and draws; agents of different parts draw differently under the same seed.
        store: where steps go and come from.
        model: to be learned at the same time (thesis 9.4.1): transitions that touch nothing of the world are observed with it.
        hands: (S, 3) m, root frame, where the marker is in each state; None: by the robot's kinematics, other parts at home.
        jacobians: (S, 3, d) m/rad, how the joints of the space move it there, where `hands` are given and these are known.

    Raises:
        UnknownName: no such predictor, strategy, way to remember failures, or marker.
        InvalidValue: a plant of another robot, or a value out of range.
        MobeeError: the store holds reaches of another space, marker or scale.
    """

    def __init__(
        self,
        space: Space,
        plant: ReachPlant,
        beliefs: OutcomeModel | None = None,
        *,
        marker: str,
        predictor: str | RewardPredictor = "weighted",
        strategy: str | StrategyOf = "intrinsic",
        failures: str = "spread",
        discount: float = 0.9,
        scale: float = SCALE,
        penalty: float = -10.0,
        limit: int = 10,
        seed: int = 0,
        store: ReachStore | None = None,
        model: TransitionModel | None = None,
        hands: Array | None = None,
        jacobians: Array | None = None,
    ) -> None:
        if plant.robot.motors != space.robot.motors:
            raise InvalidValue(f"the plant moves {plant.robot.name!r}, the space is of {space.robot.name!r}: make both from one robot.")
        reaches = reaches_of(space, marker, scale) if hands is None else Reaches(space.samples, hands, scale, jacobians)
        super().__init__(space, reaches, beliefs, predictor, strategy, failures, discount, penalty, limit, seed, model)
        self.plant, self.marker, self.store = plant, marker, store
        self._state: int | None = None
        if store is not None:
            store.bind({"space": space.settings, "marker": marker, "scale": scale})
            store.learner(self.settings)
            self.replay(store.problems(), store.load())

    @property
    def state(self) -> int:
        """Where the part is: measured at first and after whatever broke off a step, else from the last outcome."""
        if self._state is None:
            self._state = self.space.state_of(self.plant.measure(self.part)[self.space.columns])
        return self._state

    def try_problem(self, target: ReachTarget) -> Try:
        """One problem-try: present the target, go where reaching is worth most, plan again after each failure, reach, learn (thesis 8.3.1).

        Raises ActionInterrupted if the plant does; the problem-try stays under way, and the next call for the same place goes on with it.
        """
        self.begin(target)
        self.plant.present(target)
        while self.under_way is not None:
            self.step()
        assert self.last is not None
        return self.last

    def learn(self, problems: Sequence[ReachTarget], tries: int) -> None:
        """Make that many more problem-tries, each of the problem least tried, ties random; interrupted actions are decided anew (8.3.2)."""
        end = self.tries + tries
        while self.tries < end:
            target = self.problems.targets[self.under_way] if self.under_way is not None else None
            try:
                self.try_problem(self.problems.least_tried(problems, self.problem_draws()) if target is None else target)
            except ActionInterrupted:
                continue

    def plan(self, target: ReachTarget, state: int | None = None) -> ReachPlan:
        """What it would do to reach for a target from a state, from where it is if None; nothing moves or is learned."""
        return way_to_reach(self, target, self.state if state is None else state)

    def evaluate(self, problems: Sequence[ReachTarget], repetitions: int = 1) -> Evaluation:
        """How well it reaches for the problems by now (thesis 8.3.3): the robot moves, but nothing is learned."""
        try:
            return evaluate(self, problems, repetitions)
        finally:
            self._state = None

    def step(self) -> Step:
        """One action of the problem-try under way, whose target is presented; raises ActionInterrupted if the plant does."""
        state = self.state
        action = self.decide(state)
        self._state = None  # whatever breaks off the action, or its record
        step = self._reached(state) if action == REACH else self._moved(state, action)
        if self.store is not None:
            self.store.append(step, self.problems.targets)
        self.observe(step)
        self._state = step.s_next
        return step

    def _moved(self, state: int, action: int) -> Step:
        outcome, following = move(self.plant, self.space, state, action)
        failed = self.failed(state, following)
        reward = self.penalty if failed else 0.0
        return self._step_of(state, action, following, failed, reward, 0.0, 0.0, outcome)

    def _reached(self, state: int) -> Step:
        expected = self.expected(state)
        outcome, following = reach(self.plant, self.space, self.marker)
        reward = reward_of(outcome.missing, self.reaches.scale)
        return self._step_of(state, REACH, following, False, reward, expected, outcome.missing, outcome)

    def _step_of(
        self,
        state: int,
        action: int,
        following: int,
        failed: bool,
        reward: float,
        expected: float,
        missing: float,
        outcome: Outcome | ReachOutcome,
    ) -> Step:
        assert self.under_way is not None
        return Step(
            n=self.steps + 1,
            number=self.tries + 1,
            problem=self.under_way,
            s=state,
            a=action,
            s_next=following,
            failed=failed,
            reward=reward,
            expected=expected,
            missing=missing,
            settled=outcome.settled,
            duration=outcome.duration,
            q=tuple(outcome.q.tolist()),
            touched=outcome.touched,
        )
