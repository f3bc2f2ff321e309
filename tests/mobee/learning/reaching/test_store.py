# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mobee.errors import ActionInterrupted, InvalidValue, MobeeError
from mobee.learning.reaching.reach_agent import ReachAgent
from mobee.learning.reaching.store import ReachStore, Step, reaching_parts
from mobee.reach import ReachTarget
from mobee.store import Transition, TransitionStore
from tests.mobee.learning.reaching.toy import HANDS, PLACES, SPACE, TARGETS, agent, plant

ROOT = Path(__file__).parents[4]
PART = SPACE.part
LEARNER = """
import sys
from mobee.learning.reaching.store import ReachStore
from tests.mobee.learning.reaching.toy import PLACES, SPACE, TARGETS, agent

learner = agent(1, store=ReachStore(sys.argv[1], SPACE.part), strategy="random")
print("begins", flush=True)
while True:
    learner.learn(TARGETS, 1)
    print(learner.steps, flush=True)
"""


def resumed(path, until, **options) -> ReachAgent:
    """An agent that continues from the record, on a plant that is where the record ended, until so many steps are made."""
    store = ReachStore(path, PART)
    steps = store.load()
    on = plant(1)
    on.actions, on.state = len(steps), steps[-1].s_next if steps else 0
    learner = agent(1, on, store=store, **options)
    assert learner.steps == len(steps)

    def stop(do):
        def act(*given):
            if learner.steps == until:
                raise ActionInterrupted("enough")
            return do(*given)

        return act

    on.act, on.reach = stop(on.act), stop(on.reach)
    with pytest.raises(ActionInterrupted):
        while True:
            under_way = learner.under_way
            chosen = learner.problems.least_tried(TARGETS, learner.problem_draws())
            learner.try_problem(chosen if under_way is None else learner.problems.targets[under_way])
    store.close()
    return learner


@pytest.mark.parametrize("strategy", ["random", "intrinsic"])
def test_after_a_stop_at_any_step_it_continues_as_if_it_had_not_stopped(tmp_path, strategy):
    whole = resumed(tmp_path / "whole.sqlite", 55, strategy=strategy)
    for end in (1, 2, 3, 5, 8, 13, 21, 34, 55):
        parted = resumed(tmp_path / "parted.sqlite", end, strategy=strategy)
    with ReachStore(tmp_path / "whole.sqlite", PART) as one, ReachStore(tmp_path / "parted.sqlite", PART) as other:
        assert one.load() == other.load()
        assert len(one.load()) == 55 and any(step.failed for step in one.load())
    assert parted.tries == whole.tries and parted.problems.tries == whole.problems.tries
    assert parted.predictor.mean(PLACES[0]).tolist() == whole.predictor.mean(PLACES[0]).tolist()
    assert parted.failures.rewards(PLACES[0]).tolist() == whole.failures.rewards(PLACES[0]).tolist()


def test_a_kill_leaves_all_that_was_reported(tmp_path):
    path = tmp_path / "run.sqlite"
    child = subprocess.Popen([sys.executable, "-c", LEARNER, str(path)], stdout=subprocess.PIPE, text=True, cwd=ROOT)
    reports = [child.stdout.readline() for _ in range(5)]
    time.sleep(0.05)
    child.send_signal(signal.SIGKILL)
    reports += [line for line in child.communicate()[0].splitlines(keepends=True) if line.endswith("\n")]
    reported = int(reports[-1])
    with ReachStore(path, PART) as store:
        steps = store.load()
        on = plant(1)
        again = agent(1, on, store=store, strategy="random")
    assert len(steps) >= reported
    assert [step.n for step in steps] == list(range(1, len(steps) + 1))
    whole = agent(1, strategy="random")
    whole.learn(TARGETS, steps[-1].number - 1)
    assert again.tries in (whole.tries, whole.tries + 1) and whole.steps <= len(steps)


def test_a_file_says_which_parts_have_reached(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, PART):
        pass
    assert reaching_parts(path) == ()
    with ReachStore(path, PART) as store:
        assert reaching_parts(path) == ()
        agent(store=store).try_problem(TARGETS[0])
    assert reaching_parts(path) == (PART,)


def test_problems_are_kept_whole(tmp_path):
    target = ReachTarget(np.array([-0.25, 0.1, 0.05]), radius=0.03, aim="surface", normal=np.array([0.0, 0.0, 2.0]))
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        learner = agent(store=store)
        learner.begin(TARGETS[5])  # left before its first step: a problem all the same
        learner.try_problem(target)
    with ReachStore(tmp_path / "run.sqlite", PART, read_only=True) as store:
        first, kept = store.problems()
    assert first.position.tolist() == PLACES[5].tolist()
    assert kept.position.tolist() == target.position.tolist() and kept.normal.tolist() == [0.0, 0.0, 1.0]
    assert (kept.radius, kept.aim) == (0.03, "surface")


def test_reaches_lie_beside_the_transitions_of_the_part(tmp_path):
    path = tmp_path / "run.sqlite"
    with TransitionStore(path, PART) as transitions:
        transitions.bind({"seed": 3})
        transitions.append(Transition(1, 0, 0, 1, 0.1, True, 1.0, (0.0,)))
    with ReachStore(path, PART) as store:
        agent(store=store).learn(TARGETS, 3)
    with TransitionStore(path, PART, read_only=True) as transitions:
        assert transitions.agents() == (PART,) and len(transitions.load()) == 1


def test_a_record_is_bound_to_its_marker_scale_and_space(tmp_path):
    path = tmp_path / "run.sqlite"
    with ReachStore(path, PART) as store:
        agent(store=store).learn(TARGETS, 2)
        with pytest.raises(MobeeError, match="scale = 0.01 on record, now 1.0"):
            agent(store=store, scale=1.0)
        with pytest.raises(MobeeError, match="marker"):
            ReachAgent(SPACE, plant(), marker="foot", hands=HANDS, store=store)


def test_another_learner_continues_the_record(tmp_path):
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        first = agent(store=store, strategy="random")
        first.learn(TARGETS, 5)
        second = agent(store=store, strategy="greedy", failures="local", seed=9)
        assert second.predictor.mean(PLACES[0]).tolist() == first.predictor.mean(PLACES[0]).tolist()
        agent(store=store, strategy="greedy", failures="local", seed=9)
        assert [(n, settings["strategy"]) for n, settings in store.learners()] == [(0, "random"), (first.steps, "greedy")]


def test_a_file_without_reaches_is_refused_for_reading(tmp_path):
    with TransitionStore(tmp_path / "run.sqlite", PART) as transitions:
        transitions.append(Transition(1, 0, 0, 1, 0.1, True, 1.0, (0.0,)))
    with pytest.raises(MobeeError, match="no agent has learned to reach"):
        ReachStore(tmp_path / "run.sqlite", PART, read_only=True)


def test_steps_have_no_gap(tmp_path):
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        learner = agent(store=store)
        learner.learn(TARGETS, 2)
        with pytest.raises(MobeeError, match="append number 3, not 1"):
            store.append(store.load()[0], learner.problems.targets)


STEP = Step(1, 1, 0, 2, -1, 3, False, 0.5, 0.25, 0.125, True, 2.0, (0.5, 1.5), ("cup",))


def test_numbers_of_numpy_are_stored_as_plain_ones(tmp_path):
    numbers = {name: np.int64(getattr(STEP, name)) for name in ("n", "number", "problem", "s", "a", "s_next")}
    reals = {name: np.float32(getattr(STEP, name)) for name in ("reward", "expected", "missing", "duration")}
    given = replace(STEP, **numbers, **reals, failed=np.bool_(False), settled=np.bool_(True), q=np.array(STEP.q), touched=["cup"])
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        store.append(given, TARGETS)
        assert store.load() == [STEP]


@pytest.mark.parametrize("change", [{"s": 1.5}, {"reward": np.nan}, {"missing": None}, {"q": None}, {"touched": None}])
def test_what_could_not_be_read_again_is_refused(tmp_path, change):
    with ReachStore(tmp_path / "run.sqlite", PART) as store:
        with pytest.raises(InvalidValue, match="cannot be stored"):
            store.append(replace(STEP, **change), TARGETS)
        assert store.load() == [] and store.problems() == []
