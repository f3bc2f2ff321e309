# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.learning.reaching.changes import RewardScale, RunLength
from mobee.learning.reaching.failures import MAX_COST, FailuresSinceChange, failures_of
from mobee.learning.reaching.predictors import Reaches
from mobee.learning.reaching.store import ReachStore
from mobee.learning.tabular import ReachTable, ideal
from mobee.learning.transitions import TransitionModel
from mobee.reach import TARGET
from tests.mobee.learning.reaching.toy import HANDS, PLACES, SPACE, TARGETS, agent, world

HERE, THERE = PLACES[0], PLACES[20]
REACHES = Reaches(SPACE.samples, HANDS)


def detections(contradictions: list[bool]) -> list[tuple[int, int | None]]:
    """When a detector reports changes, and since how many outcomes, if some outcomes contradict what was learned."""
    detector = RunLength()
    found = [detector.add(0.001 if one else 0.95, 0.5) for one in contradictions]
    return [(number, since) for number, since in enumerate(found) if since is not None]


@pytest.mark.parametrize(("share", "most"), [(0.0, 0), (0.05, 0), (0.3, 1)])
def test_a_constant_share_of_contradictions_is_no_change(share, most):
    assert len(detections((np.random.default_rng(1).random(1500) < share).tolist())) <= most


def test_a_larger_share_is_a_change_and_is_reported_once_with_its_time():
    rng = np.random.default_rng(2)
    found = detections([*(rng.random(500) < 0.03), *(rng.random(300) < 0.4)])
    assert len(found) == 1
    number, since = found[0]
    assert 500 <= number < 540 and abs(number + 1 - since - 500) <= 10


def test_a_smaller_share_is_none():
    rng = np.random.default_rng(3)
    assert detections([*(rng.random(300) < 0.5), *(rng.random(500) < 0.02)]) == []


def test_outcomes_that_inform_of_nothing_change_nothing():
    detector = RunLength()
    assert {detector.add(0.5, 0.5) for _ in range(1000)} == {None}


def test_the_scale_of_rewards_comes_from_repeats():
    scale, rng = RewardScale(), np.random.default_rng(0)
    for _ in range(500):
        scale.add(3, HERE, float(rng.normal(0.5, 0.2)))
    assert scale.variance == pytest.approx(0.04, rel=0.2)
    assert scale.repeated(3, HERE) and not scale.repeated(3, THERE)


def test_a_change_before_the_first_transition_keeps_all_of_them():
    failures = FailuresSinceChange(SPACE, REACHES, failures_of(SPACE, REACHES, "alike"))
    for state in range(3):
        failures.add(state, 0, HERE, -10.0, ())
    failures.change(5)
    assert min(failures.blocked(state, 0) for state in range(3)) > 0.5


def test_failures_without_the_target_count_for_all_targets_after_a_change():
    usual = failures_of(SPACE, REACHES, "alike")
    failures = FailuresSinceChange(SPACE, REACHES, failures_of(SPACE, REACHES, "alike"))
    for memory in (usual, failures):
        memory.add(0, 0, HERE, -10.0, ())
        memory.add(0, 1, HERE, -10.0, (TARGET,))
        memory.add(0, 2, HERE, 0.0, ())
    assert failures.rewards(THERE).tolist() == usual.rewards(THERE).tolist() and failures.blocked(0, 0) == 0.0
    failures.change(2)
    assert failures.rewards(THERE)[0, 0] == pytest.approx(-5.0) and failures.blocked(0, 0) > 0.5
    assert failures.rewards(THERE)[0, 1] > -1.0  # the target HERE was the reason
    assert failures.rewards(THERE)[0, 2] == pytest.approx(usual.rewards(THERE)[0, 2])
    other = failures.copy()
    other.add(0, 2, HERE, -10.0, ())
    assert failures.rewards(THERE)[0, 2] > other.rewards(THERE)[0, 2]
    failures.change(0)
    assert failures.rewards(THERE).tolist() == usual.rewards(THERE).tolist()


@pytest.mark.parametrize(("best", "limit"), [(0.1, 0.5 * 0.1), (0.8, MAX_COST), (np.inf, MAX_COST)])
@pytest.mark.parametrize("kind", ["alike", "local"])
def test_after_a_change_doubt_costs_at_most_half_of_the_best_reward(kind, best, limit):
    failures = FailuresSinceChange(SPACE, REACHES, failures_of(SPACE, REACHES, kind))
    for _ in range(20):
        failures.add(0, 0, HERE, -10.0, ())
        failures.add(80, 0, HERE, 0.0, ())
    np.testing.assert_array_equal(failures.rewards(HERE, best), failures.rewards(HERE))  # no change yet
    failures.change(40)
    found = failures.rewards(HERE, best)
    assert found[0, 0] == pytest.approx(-200.0 / 21.0)  # what failed itself is no doubt
    found[0, 0] = 0.0
    assert -limit <= found.min() < -0.1 * limit


OPTIONS = {"predictor": "nearest", "strategy": "ucb", "failures": "alike"}


def changed_plant(state: int) -> ReachTable:
    """The toy after a change of the world: a quarter of the transitions end where they began, whatever the target is."""
    goals, chances = ideal(SPACE)
    stuck = np.random.default_rng(5).random(goals.shape) < 0.25
    return ReachTable(SPACE, np.where(stuck, np.arange(81)[:, None, None], goals), chances, world, 0.005, seed=1, start=state)


def test_nothing_changes_without_a_detection():
    one, other = agent(**OPTIONS), agent(detector="run_length", **OPTIONS)
    for learner in (one, other):
        learner.learn(TARGETS, 120)
    assert other.changes is not None and other.changes.detected == []
    assert [one.predictor.mean(place).tolist() for place in PLACES] == [other.predictor.mean(place).tolist() for place in PLACES]
    assert one.evaluate(TARGETS).rewards.tolist() == other.evaluate(TARGETS).rewards.tolist()
    assert "detector" not in one.settings and other.settings["detector"] == "run_length"


def test_a_change_is_detected_and_a_resumed_agent_believes_the_same(tmp_path):
    file, model = tmp_path / "run.sqlite", TransitionModel(SPACE)
    for state, action in np.argwhere(SPACE.goals >= 0).tolist():
        for _ in range(3):
            model.observe(state, action, SPACE.goal(state, action))
    options = OPTIONS | {"beliefs": model.debiased(), "detector": "run_length"}
    with ReachStore(file, SPACE.part) as store:
        learner = agent(store=store, **options)
        learner.learn(TARGETS, 80)
        learner.plant = changed_plant(learner.state)
        before = learner.steps
        learner.learn(TARGETS, 50)
    assert learner.changes is not None and len(learner.changes.detected) >= 1
    assert all(step > before for step in learner.changes.detected)
    with ReachStore(file, SPACE.part) as store:
        again = agent(store=store, **options)
    assert again.changes is not None and again.changes.detected == learner.changes.detected
    for place in PLACES[::5]:
        assert again.failures.rewards(place).tolist() == learner.failures.rewards(place).tolist()
