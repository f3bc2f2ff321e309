# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from experiments.claims.ch7_learning import changed_outcomes
from experiments.claims.ch7_learning.changed_outcomes import CHANGES, CHECK_PERIOD, WINDOW, Run, compare, plant_of, summary, trial
from experiments.kit.learning.arm import arm_space
from experiments.kit.learning.outcomes import l1, truth_of
from mobee import TransitionModel

CHECKS = 4 * WINDOW // CHECK_PERIOD  # half of them before the change


def a_run(errors):
    """Before the change no changed action is tried, afterwards no other."""
    changed = np.zeros(arm_space().goals.shape, dtype=bool)
    changed[0, 0] = True
    seen = np.zeros((CHECKS * CHECK_PERIOD, 3), dtype=int)
    seen[: len(seen) // 2, 1] = 1
    series = np.ones((CHECKS, 4))
    series[CHECKS // 2 :, 0] = errors
    series[CHECKS // 2 :, 2] = 3.0
    values = summary({"seen": seen, "series": series, "at_change": 2.0, "changed": changed, "same": ~changed})
    return Run(values["tried"], series, 2.0, changed, ~changed)


def test_tries_are_over_the_mean_of_all_actions():
    run = a_run(np.ones(CHECKS // 2))
    assert run.tries_before == 0.0
    assert run.tries_after == pytest.approx(arm_space().state_actions)
    assert run.value_jump == pytest.approx(3.0) and run.value_jump_before == pytest.approx(1.0)


def test_relearning_takes_until_the_error_is_halved_or_never_ends():
    errors = np.linspace(1.8, 0.0, CHECKS // 2)
    assert a_run(errors).relearned == CHECK_PERIOD * (np.flatnonzero(errors <= 1.0)[0] + 1)
    assert a_run(np.full(CHECKS // 2, 1.5)).relearned == np.inf


def all_succeed(but=()):
    """Every action once, to its goal, except for some (state, action), which do not leave their state."""
    space = arm_space()
    return truth_of(space, np.array([[s, a, s if (s, a) in but else space.goals[s, a]] for s, a in np.argwhere(space.goals >= 0).tolist()]))


SHORT = {"change": "object", "explorer": "curious", "forgetting": 1.0, "transitions": CHECK_PERIOD}


def test_the_error_at_the_change_is_that_of_a_model_without_later_observations(monkeypatch):
    before, after = all_succeed(), all_succeed({(0, 0), (40, 1), (80, 0)})
    monkeypatch.setattr(changed_outcomes, "truths", lambda name: (before, after))
    values = trial(SHORT, 0)
    model = TransitionModel(arm_space())
    for s, a, reached in values["seen"][:CHECK_PERIOD].tolist():
        model.observe(s, a, reached)
    assert values["changed"].sum() == 3
    assert values["at_change"] == pytest.approx(l1(model.debiased(), after)[values["changed"]].mean())


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_moves_the_end_of_an_action(name):
    space = arm_space()
    ends = []
    for is_after in (False, True):
        plant = plant_of(name, is_after, 0)
        plant.act("left_arm", space.target(39))
        ends.append(plant.act("left_arm", space.target(40 if name == "object" else 66)).q[space.columns])
    assert np.abs(ends[0] - ends[1]).max() > np.deg2rad(3.0)


def test_an_action_without_tries_after_the_change_is_neither_changed_nor_the_same():
    space = arm_space()
    goals = space.goals[0]
    before = truth_of(space, np.array([[0, 0, goals[0]], [0, 1, goals[1]], [0, 2, goals[2]]]))
    after = truth_of(space, np.array([[0, 0, 0], [0, 1, goals[1]]]))
    changed, same = compare(before, after)
    assert np.argwhere(changed).tolist() == [[0, 0]]
    assert np.argwhere(same).tolist() == [[0, 1]]


def test_an_error_that_is_halved_at_the_first_check_counts():
    assert a_run(np.full(CHECKS // 2, 0.9)).relearned == CHECK_PERIOD
