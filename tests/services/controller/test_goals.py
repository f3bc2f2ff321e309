# SPDX-License-Identifier: Apache-2.0
"""The owner of a part's goal, and the valid goals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from bus_schema import keys
from bus_schema.rpc import Done, Take, Taken, WithEpoch
from services.common.rpc import CallFailed
from tests.services.controller.stage import HEAD, ROBOT, Stage, near, refused
from tests.services.harness import wait_for


def test_a_goal_belongs_to_one_owner_while_its_token_is_there(run: Stage) -> None:
    first, epoch = run.own("left_arm", "agent_left_arm")
    assert "agent_left_arm" in refused("owned", lambda: run.own("left_arm", "agent_rival"))
    run.own("right_arm", "agent_rival")  # another part is free
    newer = run.take("left_arm", first, "agent_left_arm")
    assert newer is not None
    assert newer > epoch
    refused("epoch", lambda: run.goal("left_arm", epoch, near("left_arm")))
    run.goal("left_arm", newer, near("left_arm"))
    run.leave("agent_left_arm", first)
    _, rival = wait_for(lambda: _try(lambda: run.own("left_arm", "agent_rival")), "the goal to be free")
    assert rival > newer
    refused("epoch", lambda: run.goal("left_arm", newer, near("left_arm")))


def _try(call: Callable[[], Any]) -> Any:
    try:
        return call()
    except CallFailed:
        return None


def test_a_goal_cannot_be_taken_without_a_token(run: Stage) -> None:
    refused("token", lambda: run.rig.call(keys.goal("torso", "take"), Take, Taken, who="ghost", instance="n0"))


def test_a_released_goal_is_free_and_its_part_stays(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm"))
    run.ticks(20)
    run.rig.call(keys.goal("left_arm", "release"), WithEpoch, Done, epoch=epoch)
    refused("epoch", lambda: run.goal("left_arm", epoch, near("left_arm")))
    run.tick()
    assert (run.motion("left_arm").status, run.motion("left_arm").epoch) == ("idle", 0)
    run.own("left_arm", "agent_next")


def test_a_goal_outside_the_limits_is_refused_with_motor_and_range(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.tick()
    before = run.motion("left_arm").goal
    q = near("left_arm")
    q[3] = ROBOT.limits[ROBOT.part("left_arm").slice][3, 1] + 0.01
    text = refused("limits", lambda: run.goal("left_arm", epoch, q))
    assert "l_elbow" in text
    assert f"to {q[3] - 0.01:.4f}" in text
    refused("length", lambda: run.goal("left_arm", epoch, q[:3]))
    refused("value", lambda: run.goal("left_arm", epoch, np.full(16, np.nan)))
    run.tick()
    assert (run.motion("left_arm").goal, run.motion("left_arm").status) == (before, "idle")


def test_a_goal_at_the_limits_is_accepted_in_spite_of_rounding(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    for limits, rounding in zip(ROBOT.limits[ROBOT.part("left_arm").slice].T, (-5e-10, 5e-10), strict=True):
        run.goal("left_arm", epoch, limits + rounding)


def test_when_an_agent_ends_its_part_stays_and_the_others_continue(run: Stage) -> None:
    who, other = "agent_left_arm", "agent_right_arm"
    dying, epoch = run.own("left_arm", who)
    _, living = run.own("right_arm", other)
    run.goal("left_arm", epoch, near("left_arm", 0.8), "dying")
    run.goal("right_arm", living, near("right_arm"), "living")
    run.ticks(30)
    assert np.abs(run.motion("left_arm").dq).max() > 0.1
    run.leave(who, dying)
    run.play(lambda: run.motion("left_arm").status == "idle", "the part to stay", ticks=1000)
    there = np.array(run.motion("left_arm").goal)
    assert np.abs(there - run.sim.of("left_arm")).max() < 0.05  # where it was measured
    assert run.motion("left_arm").epoch == 0
    run.play(lambda: run.motion("right_arm").status == "settled", "the other action")
    np.testing.assert_allclose(run.motion("left_arm").goal, there, atol=1e-15)
    assert run.motion("right_arm").action_id == "living"


def test_the_head_goes_to_its_posture(run: Stage) -> None:
    np.testing.assert_allclose(run.motion("head").goal, HEAD, atol=1e-15)
    run.play(lambda: abs(run.sim.of("head")[0] - HEAD[0]) < 0.02, "the head")
    assert abs(run.sim.of("head")[2] - HEAD[2]) < 0.02
