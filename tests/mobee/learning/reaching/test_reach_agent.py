# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import ActionInterrupted, InvalidValue, MobeeError, UnknownName
from mobee.learning.object_space import Grid, ObjectSpace
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore
from mobee.learning.tabular import ReachTable, ideal
from mobee.learning.transitions import TransitionModel
from mobee.plant import Outcome
from mobee.reach import ReachTarget, reward_of
from mobee.robot.load import load_robot
from tests.mobee.learning.reaching.toy import HANDS, PLACES, SPACE, TARGETS, agent, plant
from tests.mobee.learning.worlds import space_of

ROW = space_of([[1, -1], [0, 2], [1, 3], [2, -1]])  # a corridor of four states
GOAL = ReachTarget(np.array([0.0, 0.0, 0.2]))
MISSING = np.array([0.09, 0.04, 0.09, 0.0])  # reaching from the last state arrives: rewards .1, .2, .1, 1


def corridor(blocked=(), touching=True, start=0, beliefs=None, **options) -> ReachAgent:
    """An agent in the corridor, whose target blocks the transitions given as (state, action)."""
    chances = np.zeros((4, 2))
    for state, action in blocked:
        chances[state, action] = 1.0

    class Corridor(ReachTable):
        def act(self, part, target):
            outcome = super().act(part, target)
            return outcome if touching else Outcome(outcome.q, outcome.settled, outcome.duration)

    table = Corridor(ROW, *ideal(ROW), lambda target: (MISSING, chances), start=start)
    return ReachAgent(ROW, table, beliefs, marker="hand", hands=np.zeros((4, 3)), **options)


def test_at_first_it_reaches_from_where_it_is():
    reacher = corridor(strategy="greedy")
    made = reacher.try_problem(GOAL)
    assert (made.number, made.problem, made.path, made.reach_state) == (1, 0, (), 0)
    assert (made.expected, made.reward, made.missing) == (1.0, pytest.approx(0.1), pytest.approx(0.09))
    assert made.intrinsic == pytest.approx(0.9)
    assert (made.duration, made.timeouts, made.failures) == (2.0, 0, 0)
    assert (reacher.tries, reacher.steps, reacher.problems.tries) == (1, 1, [1])


def test_what_was_expected_is_taken_just_before_the_reach():
    reacher = corridor(strategy="greedy", start=3)
    expected = [reacher.try_problem(GOAL).expected for _ in range(3)]
    assert expected == pytest.approx([1.0, 1.0, 1.0])  # from 3 it always arrives: eq. 8.5 stays at 1
    elsewhere = ReachTarget(GOAL.position + [0.03, 0.0, 0.0])
    other = corridor(strategy="greedy", discount=0.0)
    assert [other.try_problem(target).expected for target in (GOAL, GOAL, elsewhere)] == pytest.approx(
        [1.0, 1.1 / 2.0, (1 + 0.25 * 0.2) / 1.5]
    )


def test_it_goes_where_it_learned_to_reach_from():
    reacher = corridor(strategy="greedy")
    for _ in range(12):
        made = reacher.try_problem(GOAL)
        reacher.plant.state, reacher._state = 0, None
    assert [state for _, _, state, _ in made.path] == [1, 2, 3]
    assert made.reach_state == 3 and made.reward == 1.0
    way = reacher.plan(GOAL, 0)
    assert (way.path, way.actions, way.state) == ((0, 1, 2, 3), (0, 1, 1), 3)
    assert way.expected == 1.0 and way.success == pytest.approx(0.75**3) and way.avoided == ()


def test_a_transition_that_does_not_climb_fails_and_the_plan_is_made_anew():
    reacher = corridor(blocked=[(1, 1)], strategy="greedy")
    for state, reward in ((0, 0.1), (1, 0.2)):
        for _ in range(9):
            reacher.predictor.add(state, GOAL.position, reward, 1.0)
    made = reacher.try_problem(GOAL)
    assert made.path == ((0, 0, 1, False), (1, 1, 1, True))
    assert made.reach_state == 1 and made.failures == 1
    rewards = reacher.failures.rewards(GOAL.position)
    assert rewards[1, 1] == pytest.approx(-10 / 2) and rewards[0, 0] == 0.0
    assert reacher.plan(GOAL, 0).avoided == ((1, 2),)


def test_a_problem_try_without_a_reach_ends_at_the_limit():
    reacher = corridor(limit=2)
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    made = reacher.try_problem(GOAL)
    assert made.path == ((0, 0, 1, False), (1, 1, 2, False))
    assert (made.reach_state, made.reward, made.expected, made.intrinsic, made.missing) == (None, 0.0, 0.0, 0.0, 0.0)
    assert (reacher.tries, reacher.problems.tries) == (1, [1])


class Fixed:
    def __init__(self, worth):
        self.worth = np.array(worth)

    def add(self, state, target, reward, expected):
        pass

    def rewards(self, target, rng):
        return self.worth


def test_the_state_drawn_by_random_is_kept_when_plans_are_made_anew():
    reacher = agent(strategy="random")
    drawn = []
    rewards = reacher._strategy.rewards
    reacher._strategy.rewards = lambda target, rng: drawn.append(1) or rewards(target, rng)
    for _ in range(30):
        reacher.try_problem(TARGETS[0])
    assert reacher.last.number == len(drawn) == 30
    assert np.count_nonzero(reacher.failures.rewards(PLACES[0])) > 5


def test_the_least_tried_problems_come_first():
    reacher = agent()
    reacher.learn(TARGETS, 40)
    assert sorted(reacher.problems.tries) == [1] * 14 + [2] * 13
    assert reacher.tries == 40
    new = ReachTarget(np.array([-0.2, 0.1, 0.1]))
    reacher.learn([*TARGETS[:3], new], 1)
    assert reacher.problems.tries[-1] == 1 and len(reacher.problems) == 28


def test_the_seed_decides_what_is_learned():
    def path(seed):
        reacher = agent(seed)
        reacher.learn(TARGETS, 20)
        return [reacher.last, reacher.steps, reacher.predictor.mean(PLACES[0]).tolist()]

    assert path(3) == path(3)
    assert path(3) != path(4)


def test_an_evaluation_leaves_no_trace_in_what_was_learned():
    on = plant(5)
    reacher = agent(5, on)
    reacher.learn(TARGETS, 60)
    before = (reacher.predictor.mean(PLACES[3]).tolist(), reacher.failures.rewards(PLACES[3]).tolist(), reacher.tries, reacher.steps)
    where = on.state, on.actions
    found = reacher.evaluate(TARGETS, 2)
    assert (
        reacher.predictor.mean(PLACES[3]).tolist(),
        reacher.failures.rewards(PLACES[3]).tolist(),
        reacher.tries,
        reacher.steps,
    ) == before
    assert found.rewards.shape == (2, 27) and found.scores == pytest.approx(found.rewards.sum(axis=1))
    assert on.actions - where[1] >= found.actions.sum()
    on.state, on.actions = where
    reacher.learn(TARGETS, 20)
    other = agent(5)
    other.learn(TARGETS, 80)
    assert other.last == reacher.last and other.steps == reacher.steps


def test_an_evaluation_reaches_from_where_most_is_expected_and_gets_what_the_table_pays():
    reacher = corridor(strategy="greedy", start=2)
    for state, missing in enumerate(MISSING):
        for _ in range(50):
            reacher.predictor.add(state, GOAL.position, reward_of(missing), 1.0)
    found = reacher.evaluate([GOAL], 4)
    assert found.states.tolist() == [[3]] * 4
    assert found.scores.tolist() == [1.0] * 4 and found.missing.tolist() == [[0.0]] * 4 and not found.failures.any()
    assert set(found.actions[:, 0]) <= {1, 2, 3, 4}
    assert found.duration[:, 0].tolist() == (found.actions[:, 0] + 1).tolist()


def test_failures_in_an_evaluation_are_remembered_until_its_end():
    reacher = corridor(blocked=[(2, 1)], strategy="greedy")
    for state in range(4):
        for _ in range(50):
            reacher.predictor.add(state, GOAL.position, reward_of(MISSING[state]), 1.0)
    found = reacher.evaluate([GOAL, GOAL], 8)
    assert set(found.failures.sum(axis=1)) == {0, 1}  # none from behind the failing transition, else the first of two problems
    assert not reacher.failures.rewards(GOAL.position).any()


def test_learning_the_model_too_a_failure_without_contact_is_the_models():
    model = TransitionModel(ROW)
    reacher = corridor(blocked=[(0, 0)], touching=False, model=model)
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    reacher.try_problem(GOAL)
    assert model.tries[0, 0] == reacher.last.failures == 10
    assert not reacher.failures.rewards(GOAL.position).any()
    assert model.debiased().probabilities[0, 0, 1] == pytest.approx(0.3 / 10.4)


def test_learning_the_model_too_a_failure_that_touched_the_world_is_the_problems():
    model = TransitionModel(ROW)
    reacher = corridor(blocked=[(0, 0)], model=model)
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    reacher.try_problem(GOAL)
    assert model.tries.sum() == 0
    assert reacher.failures.rewards(GOAL.position)[0, 0] == pytest.approx(-5.0)
    assert reacher.last.reach_state == 0  # there is no other way


def test_an_interrupted_action_is_no_step_and_the_try_continues():
    class Held(ReachTable):
        held = 3

        def act(self, part, target):
            if self.actions == self.held:
                self.held = -1
                raise ActionInterrupted("held")
            return super().act(part, target)

    table = Held(ROW, *ideal(ROW), lambda target: (MISSING, np.zeros((4, 2))))
    reacher = ReachAgent(ROW, table, None, marker="hand", hands=np.zeros((4, 3)))
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    table.actions = 2
    with pytest.raises(ActionInterrupted):
        reacher.try_problem(GOAL)
    assert (reacher.steps, reacher.tries, reacher.under_way) == (1, 0, 0)
    made = reacher.try_problem(GOAL)
    assert [state for _, _, state, _ in made.path] == [1, 2, 3] and made.reach_state == 3
    assert (reacher.steps, reacher.tries) == (4, 1)


def test_a_step_that_cannot_be_kept_is_none_and_where_the_part_is_is_measured_anew():
    class Full:
        full = True

        def append(self, step, targets):
            if self.full:
                raise MobeeError("the disk is full")

        def after(self, n):
            return []

    reacher = corridor()
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    reacher.store = Full()
    with pytest.raises(MobeeError, match="disk"):
        reacher.try_problem(GOAL)
    assert (reacher.steps, reacher.plant.state, reacher.state) == (0, 1, 1)
    reacher.store.full = False
    assert [state for state, _, _, _ in reacher.try_problem(GOAL).path] == [1, 2]


class Returning(Fixed):
    """A strategy that returns whatever it is made with."""

    def __init__(self, worth):
        self.worth = worth


@pytest.mark.parametrize(
    ("worth", "said"),
    [
        ([0.5, 0.5, 0.5], r"of shape \(3,\)"),
        ([[0.5]] * 4, r"of shape \(4, 1\)"),
        ([0.5, np.nan, 0.5, 0.5], "1 of which are NaN or infinite"),
        ([np.inf, 0.5, 0.5, 0.5], "1 of which are NaN or infinite"),
        ([-np.inf] * 4, "none of which is finite"),
        (["much"] * 4, "array of numbers"),
        (None, "array of numbers"),
    ],
)
def test_rewards_that_are_no_number_for_each_state_are_refused_before_the_robot_moves(worth, said):
    reacher = corridor(strategy=lambda reaches, predictor: Returning(worth))
    with pytest.raises(InvalidValue, match=f"strategy.*{said}"):
        reacher.learn([GOAL], 1)
    assert reacher.steps == 0


def test_rewards_may_be_a_list():
    reacher = corridor(strategy=lambda reaches, predictor: Returning([0.0, 0.0, 0.0, 1.0]))
    assert reacher.try_problem(GOAL).reach_state == 3


def test_what_is_of_another_space_or_no_strategy_or_predictor_is_refused():
    other = TransitionModel(SPACE)
    with pytest.raises(InvalidValue, match="beliefs of 81 states, 16 actions, for a space of 4 states"):
        corridor(beliefs=other.debiased())
    with pytest.raises(InvalidValue, match="the model learns <Lattice of left_arm: 81 states"):
        corridor(model=other)
    with pytest.raises(InvalidValue, match="made None: it needs the methods rewards and add"):
        corridor(strategy=lambda reaches, predictor: None)
    with pytest.raises(InvalidValue, match="made None: it needs add, mean"):
        corridor(predictor=lambda reaches: None)


@pytest.mark.parametrize("counted", [True, False])
def test_an_interrupted_write_is_learnt_if_it_is_on_disk(tmp_path, counted, monkeypatch):
    with ReachStore(tmp_path / "steps.sqlite", "left_arm") as store:
        reacher, whole = corridor(store=store), corridor()
        append, written = store.append, []

        def interrupted(step, targets):
            append(step, targets)
            if not counted:
                store._last, store._problems = store._last - 1, 0  # as if the interrupt had come within the call
            written.append(step)
            raise KeyboardInterrupt

        for _ in range(4):
            monkeypatch.setattr(store, "append", interrupted)
            with pytest.raises(KeyboardInterrupt):
                reacher.learn([GOAL], 1)
            monkeypatch.undo()
        reacher.learn([GOAL], 3)
        whole.learn([GOAL], reacher.tries)
        assert len(written) == 4 and store.load()[0] == written[0]
        assert len(store.load()) == reacher.steps == whole.steps and reacher.last == whole.last


def test_an_interrupted_write_is_learnt_before_another_target_begins(tmp_path, monkeypatch):
    with ReachStore(tmp_path / "steps.sqlite", "left_arm") as store:
        reacher = corridor(store=store)
        append = store.append

        def interrupted(step, targets):
            append(step, targets)
            raise KeyboardInterrupt

        reacher.begin(GOAL)
        reacher.plant.present(GOAL)
        monkeypatch.setattr(store, "append", interrupted)
        with pytest.raises(KeyboardInterrupt):
            reacher.step()
        monkeypatch.undo()
        other = ReachTarget(np.array([0.1, 0.0, 0.0]))
        reacher.begin(other)
        assert reacher.steps == 1 and reacher.problems.tries == [1, 0]
        reacher.plant.present(other)
        reacher.step()
        assert [(step.n, step.problem) for step in store.load()] == [(1, 0), (2, 1)]


def test_a_try_left_for_another_problem_has_ended():
    reacher = corridor()
    reacher._strategy = Fixed([0.0, 0.0, 0.0, 1.0])
    reacher.begin(GOAL)
    reacher.plant.present(GOAL)
    assert (reacher.planned()[0] > 0.0).any()
    assert reacher.step().n == 1
    made = reacher.try_problem(ReachTarget(np.array([0.1, 0.0, 0.0])))
    assert made.number == 2 and reacher.problems.tries == [1, 1]


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"strategy": "intrinsik"}, UnknownName, "intrinsic"),
        ({"predictor": "weigthed"}, UnknownName, "weighted"),
        ({"failures": "far"}, UnknownName, "local"),
        ({"penalty": 0.0}, InvalidValue, "below 0"),
        ({"limit": 0}, InvalidValue, "at least 1"),
        ({"scale": 0.0}, InvalidValue, "scale"),
        ({"discount": 1.0}, InvalidValue, "discount"),
    ],
)
def test_invalid_arguments_are_refused(options, error, message):
    with pytest.raises(error, match=message):
        agent(**options).try_problem(TARGETS[0])


@pytest.mark.parametrize("problems", [[GOAL, [0.0, 0.0, 0.2]], np.zeros((2, 3)), GOAL, ["cup"]], ids=["place", "array", "alone", "text"])
def test_problems_that_are_no_targets_are_refused_before_the_robot_moves(problems):
    reacher = corridor()
    acted = []
    reacher.plant.act = acted.append
    for start in (reacher.learn, reacher.evaluate):
        with pytest.raises(InvalidValue, match="ReachTarget"):
            start(problems, 1)
    with pytest.raises(InvalidValue, match="must be a ReachTarget"):
        reacher.try_problem([0.0, 0.0, 0.2])
    assert not acted and reacher.tries == 0


@pytest.mark.parametrize("count", [-1, 1.5, "2"])
def test_a_number_of_tries_or_repetitions_that_is_no_count_is_refused(count):
    with pytest.raises(InvalidValue, match=f"tries={count!r}: give a whole number"):
        corridor().learn([GOAL], count)
    with pytest.raises(InvalidValue, match=f"repetitions={count!r}: give a whole number"):
        corridor().evaluate([GOAL], count)


def test_a_plant_of_another_robot_is_refused():
    on = plant()
    on.robot = load_robot("katana")
    with pytest.raises(InvalidValue, match="make both from one robot"):
        ReachAgent(SPACE, on, marker="hand", hands=HANDS)
    with pytest.raises(InvalidValue, match="make both from one robot"):
        agent().practise(on, TARGETS, 1)


def test_a_space_with_an_object_is_refused():
    space = ObjectSpace(ROW, Grid((0.0, 0.1), (0.0, 0.1), (2, 2)), "cup")
    with pytest.raises(InvalidValue, match=r"Give it the postures alone, `space\.postures`"):
        ReachAgent(space, corridor().plant, marker="hand", hands=HANDS)


def test_practice_on_another_plant_is_learned_and_moves_the_own_robot_not_at_all():
    blocked = [(0, 0)]  # in the world as it is perceived now, there is no path from state 0
    reacher, imagined = corridor(detector="run_length", touching=False), corridor(blocked, touching=False).plant
    reacher.learn([GOAL], 5)
    own, before = reacher.plant, reacher.plant.measure(reacher.part).copy()
    reacher.begin(GOAL)
    reacher.practise(imagined, [GOAL], 10)
    assert reacher.plant is own and own.measure(reacher.part).tolist() == before.tolist()
    assert (reacher.tries, reacher.under_way, reacher.changes.detected) == (15, None, [])
    assert reacher.failures.blocked(0, 0) > 0.5
    assert reacher.failures.rewards(np.ones(3))[0, 0] < -1.0  # for all targets


def test_the_detector_starts_anew_before_and_after_practice():
    """Neither the change that is perceived nor the differences of the two plants are evidence about later changes."""
    outcomes = []

    class Counting:
        def __init__(self):
            outcomes.append(0)

        def add(self, learned, unknown):
            outcomes[-1] += 1

    reacher = corridor(detector=Counting)
    reacher.learn([GOAL], 5)
    reacher.practise(corridor().plant, [GOAL], 3)
    reacher.learn([GOAL], 2)
    assert len(outcomes) == 3 and all(outcomes)


@pytest.mark.parametrize("detector", ["none", "run_length"])
def test_the_predictor_compares_the_rewards_of_practice_with_those_of_the_own_robot(detector):
    """World 0 is the one before practice, 1 the other plant, and 2 the own robot after practice."""
    reacher = corridor(detector=detector, predictor="gp")
    reacher.learn([GOAL], 5)
    reacher.practise(corridor().plant, [GOAL], 7)
    reacher.learn([GOAL], 3)
    reached = reacher.predictor._reached
    assert [int(reached.count[reached.world == world].sum()) for world in range(3)] == [5, 7, 3]


def test_practice_does_not_write_into_a_store(tmp_path):
    with ReachStore(tmp_path / "steps.sqlite", "left_arm") as store:
        reacher = corridor(store=store)
        with pytest.raises(InvalidValue, match="an agent with a store cannot practise"):
            reacher.practise(corridor().plant, [GOAL], 1)
