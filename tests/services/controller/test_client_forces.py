# SPDX-License-Identifier: Apache-2.0
"""Forces that the owner of a goal adds."""

from __future__ import annotations

import numpy as np

from mobee import Model
from mobee.control.forces import LARGEST_FORCE
from tests.services.controller.stage import PARTS, ROBOT, Stage, refused


def test_a_push_at_a_marker_moves_the_arm_until_it_is_cleared(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    _, other = run.own("right_arm", "agent_right_arm")
    where = Model(ROBOT).evaluate(run.sim.q).position("left_palm")
    run.force("left_arm", epoch, marker="left_palm", push=[0.0, 0.0, 30.0])
    run.force("right_arm", other, f=[1.0] + [0.0] * 15)
    run.ticks(60)
    moved = Model(ROBOT).evaluate(run.sim.q).position("left_palm") - where
    assert moved[2] > 0.005
    assert run.motion("right_arm").dq[0] > 1e-4
    run.force("left_arm", epoch)
    far = np.abs(run.sim.q - run.rig.robot.home)
    run.ticks(150)
    left, right = (ROBOT.part(part).start for part in ("left_arm", "right_arm"))
    now = np.abs(run.sim.q - run.rig.robot.home)
    assert now[left] < 0.5 * far[left]  # back to the attractor
    assert now[right] > far[right] > 0.002  # the other part's force continues


def test_a_wrong_force_is_refused(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    assert "left_palm" in refused("force", lambda: run.force("left_arm", epoch, marker="left_plam", push=[0.0, 0.0, 1.0]))
    refused("force", lambda: run.force("left_arm", epoch, marker="left_palm"))
    refused("force", lambda: run.force("left_arm", epoch, push=[0.0, 0.0, 1.0]))
    assert "does not move" in refused("force", lambda: run.force("left_arm", epoch, marker="right_palm", push=[0.0, 0.0, 1.0]))
    refused("length", lambda: run.force("left_arm", epoch, f=[1.0]))
    refused("epoch", lambda: run.force("left_arm", epoch - 1, f=[0.0] * 16))


def test_forces_of_any_size_leave_the_law_with_numbers(run: Stage) -> None:
    owned = {part: run.own(part, f"agent_{part}")[1] for part in ("torso", "left_arm")}
    for part, epoch in owned.items():
        refused("force", lambda part=part, epoch=epoch: run.force(part, epoch, marker="left_palm", push=[1.7e308, 0.0, 0.0]))
        refused("force", lambda part=part, epoch=epoch: run.force(part, epoch, f=[-1e300] * len(ROBOT.part(part))))
        run.force(part, epoch, f=[LARGEST_FORCE / len(PARTS)] * len(ROBOT.part(part)))
        run.force(part, epoch, marker="left_palm", push=[1e8, -1e8, 1e8])
        run.force(part, epoch, f=[-1e8] * len(ROBOT.part(part)))
    run.ticks(20)
    assert run.statuses() == {"idle"}
    assert 0.01 < np.abs([*run.motion("torso").dq, *run.motion("left_arm").dq]).max() <= 1.1


def test_forces_end_with_a_hold_and_with_their_owner(run: Stage) -> None:
    instance, epoch = run.own("left_arm")
    for end in (lambda: run.sim.hold("left_arm"), lambda: run.leave("agent_test", instance)):
        run.force("left_arm", epoch, f=[5.0] + [0.0] * 15)
        run.play(lambda: run.motion("left_arm").dq[0] > 0.02, "the push", ticks=100)
        end()
        run.ticks(60)
        run.play(lambda: run.motion("left_arm").status == "idle", "its return")
        assert abs(run.motion("left_arm").dq[0]) < 0.01
