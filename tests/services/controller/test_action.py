# SPDX-License-Identifier: Apache-2.0
"""An action moves a part until it settles or its time is over."""

from __future__ import annotations

import numpy as np
import pytest

from bus_schema.messages import GateState
from mobee import Gains
from services.controller.action import LONGEST_SUSPENSION, MOST_SUSPENSIONS, Action
from tests.services.controller.stage import ROBOT, SETTLE, Stage, near


def test_an_action_moves_and_settles_at_its_goal(run: Stage) -> None:
    run.model.touched = {"left_arm": ["table"]}
    _, epoch = run.own("left_arm")
    started = run.goal("left_arm", epoch, near("left_arm"), "go")
    assert started.k == run.rig.bus.k
    run.tick()
    moving = run.motion("left_arm")
    assert (moving.status, moving.action_id, moving.epoch, moving.start_k) == ("moving", "go", epoch, started.k)
    run.play(lambda: run.motion("left_arm").status != "moving", "the end")
    done = run.motion("left_arm")
    assert (done.status, done.action_id, done.touched) == ("settled", "go", ["table"])
    assert (done.since_k - done.start_k) * 0.01 >= SETTLE.first_check
    np.testing.assert_allclose(done.goal, near("left_arm"), atol=1e-15)
    moves = Gains.published_2014().weight(ROBOT.part("left_arm").motors) > 0  # the published gains leave the fingers alone
    np.testing.assert_allclose(np.array(done.q)[moves], near("left_arm")[moves], atol=0.05)
    assert np.abs(np.array(done.q) - ROBOT.home[ROBOT.part("left_arm").slice]).max() > 0.2
    assert {run.motion(p).status for p in ("torso", "right_arm")} == {"idle"}
    run.ticks(5)
    assert run.motion("left_arm").since_k == done.since_k


def test_an_action_that_does_not_die_down_times_out(run: Stage) -> None:
    _, epoch = run.own("torso")
    run.sim.frozen = True  # the spring pulls indefinitely, so the commanded velocity stays
    run.goal("torso", epoch, near("torso", 0.5), "in_vain")
    for _ in range(60):
        if run.motion("torso").status == "timeout":
            break
        run.tick(skip=49)
    motion = run.motion("torso")
    assert (motion.status, motion.action_id) == ("timeout", "in_vain")
    assert (motion.since_k - motion.start_k) * 0.01 == pytest.approx(SETTLE.timeout, abs=0.5)


def test_a_second_goal_replaces_the_first(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"), "one")
    run.ticks(5)
    run.goal("left_arm", epoch, near("left_arm", -0.2), "two")
    run.tick()
    motion = run.motion("left_arm")
    assert (motion.action_id, motion.status) == ("two", "moving")
    np.testing.assert_allclose(motion.goal, near("left_arm", -0.2), atol=1e-15)


def begun(target: bool = True) -> Action:
    action = Action(SETTLE)
    action.start("a", 0, 0.0, np.zeros(3) if target else None)
    return action


def test_an_action_waits_for_the_end_of_a_hold_but_not_for_ever() -> None:
    action = begun()
    assert action.may_continue(1.0, "hold")
    action.suspend(100, 1.0)
    assert action.status == "suspended" and action.is_in_hold and action.is_under_way
    assert action.may_continue(1.0 + LONGEST_SUSPENSION, "idle")
    assert not action.may_continue(1.01 + LONGEST_SUSPENSION, "idle")


def test_an_action_that_is_held_again_and_again_ends() -> None:
    action = begun()
    for number in range(MOST_SUSPENSIONS):
        assert action.may_continue(float(number), "hold")
        action.suspend(100 * number, float(number))
        action.settle_again(100 * number, float(number))
    assert not action.may_continue(9.0, "hold")
    action.start("b", 1000, 10.0, np.zeros(3))
    assert action.may_continue(11.0, "hold")


@pytest.mark.parametrize("gate", ["estop", "fault"])
def test_an_emergency_stop_and_a_fault_end_an_action(gate: GateState) -> None:
    action = begun()
    assert not action.may_continue(1.0, gate)
    action.suspend(100, 1.0)
    assert not action.may_continue(1.1, gate)


def test_a_reach_and_an_action_that_has_ended_do_not_continue() -> None:
    ended = begun()
    ended.hold(100)
    assert not begun(target=False).may_continue(1.0, "hold")
    assert not ended.may_continue(1.0, "hold")


def test_an_action_whose_owner_goes_in_a_suspension_is_held() -> None:
    action = begun()
    action.suspend(100, 1.0)
    action.lose_owner(110)
    assert action.status == "held" and action.owner is None
