# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import numpy as np
import pytest

from mobee.errors import ActionInterrupted, InvalidValue
from mobee.learning.agent import CuriousAgent
from mobee.learning.value_iteration import value_iteration
from mobee.plant import Outcome
from mobee.store import TransitionStore
from tests.mobee.learning.toys import FickleDice, InstantPlant, arm, toy_robot


def agent(**options):
    made = CuriousAgent(arm(), FickleDice(toy_robot(), seed=1), **options)
    made.run(60)
    return made


def test_a_plan_is_made_once_a_transition():
    one = agent()
    first = one.plan()
    assert one.plan() is first
    assert one.plan(key="other") is not first
    one.step()
    assert one.plan() is not first


def test_a_plan_for_other_rewards_or_beliefs_is_another_plan():
    one = agent()
    reward = np.where(one.space.goals >= 0, 1.0, -np.inf)
    assert one.plan(reward, key="mine")[0] == pytest.approx(1 / (1 - one.discount), rel=0.2)
    assert one.plan(reward, key="mine") is one.plan(reward, key="mine")
    assert one.plan(2 * reward, key="mine") is not one.plan(reward, key="mine")


def test_warm_plans_are_within_their_tolerance_of_exact_ones():
    one = agent(tolerance=1e-3)
    exact, _ = value_iteration(one.model, one.model.reward, one.discount, tolerance=1e-12)
    largest = one.model.reward.max()
    assert np.abs(one.plan()[0] - exact).max() <= 1e-3 * largest * one.discount / (1 - one.discount)


def test_the_published_tolerance_can_be_had():
    one = agent(tolerance=1e-3, relative=False)
    exact, _ = value_iteration(one.model, one.model.reward, one.discount, tolerance=1e-12)
    assert np.abs(one.plan()[0] - exact).max() <= 1e-3 * one.discount / (1 - one.discount)
    assert one.settings["tolerance"] == 1e-3 and one.settings["relative"] is False


def test_an_interrupted_decision_leaves_no_trace_in_later_plans():
    def run(interrupted):
        one = CuriousAgent(arm(), InstantPlant(toy_robot()))
        for n in range(30):
            if interrupted and n % 3 == 0:
                one.decide(n)  # from somewhere else
                one.plan(np.where(one.space.goals >= 0, float(n), -np.inf))
                one.interrupt()
            target = one.target(one.decide(n))
            one.observe(Outcome(target, True, 1.0))
        return one

    one, other = run(True), run(False)
    assert np.array_equal(one.plan()[1], other.plan()[1])
    assert one.last == other.last


def test_plans_are_read_only():
    values, _ = agent().plan()
    with pytest.raises(ValueError, match="read-only"):
        values[0] = 1.0


def test_an_interruption_of_the_plant_undoes_the_plans_too():
    class Held(InstantPlant):
        def act(self, part, target):
            raise ActionInterrupted("held")

    one = CuriousAgent(arm(), Held(toy_robot()))
    before = one.plan()
    with pytest.raises(ActionInterrupted):
        one.step()
    assert one.plan() is not before
    assert np.array_equal(one.plan()[1], before[1])


@pytest.mark.parametrize("options", [{"discount": 1.0}, {"discount": -0.1}, {"tolerance": 0.0}, {"tolerance": np.nan}])
def test_settings_out_of_range_are_refused_before_anything_is_on_record(tmp_path, options):
    with TransitionStore(tmp_path / "run.sqlite", "left_arm") as store:
        with pytest.raises(InvalidValue, match="(discount|tolerance)=.*: valid is"):
            CuriousAgent(arm(), InstantPlant(toy_robot()), store=store, **options)
        assert store.settings() == {}
