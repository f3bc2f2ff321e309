# SPDX-License-Identifier: Apache-2.0
"""An action moves a part until it settles or its time is over."""

from __future__ import annotations

import numpy as np
import pytest

from mobee import Gains
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
