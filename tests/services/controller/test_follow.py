# SPDX-License-Identifier: Apache-2.0
"""An attractor that its owner moves, and from whom a goal may be taken."""

from __future__ import annotations

import numpy as np

from bus_schema.messages import Follow
from services.controller.precedence import may_take_from
from tests.services.controller.stage import ROBOT, Stage, near, refused
from tests.services.harness import wait_for

HEAD = ROBOT.part("head").slice
YAW = ROBOT.motor_index("neck_yaw") - HEAD.start
SPEED = 0.6  # rad/s, twice what the spring can


def follow(run: Stage, epoch: int, ticks: int, speed: float = SPEED) -> list[float]:
    """Move the attractor of the head to the left for some ticks; the positions of the neck."""
    stream = run.rig.bus.publisher(Follow, "head")
    q, dq, seen = np.array(run.sim.of("head")), np.zeros(6), []
    dq[YAW] = speed
    for k in range(ticks):
        stream.put(epoch=epoch, q=(q + k * run.sim.dt_ns * 1e-9 * dq).tolist(), dq=dq.tolist())
        run.tick()
        seen.append(float(run.sim.of("head")[YAW]))
    return seen


def test_a_part_follows_its_owners_attractor_and_stops_when_it_is_no_longer_moved(run: Stage) -> None:
    _, epoch = run.own("head", "gaze")
    seen = follow(run, epoch, 40)
    assert seen[-1] - seen[-11] > 0.9 * 10 * SPEED * run.sim.dt_ns * 1e-9  # as fast as the attractor
    assert run.motion("head").status == "idle"
    goal = run.motion("head").goal
    run.ticks(25)
    assert abs(run.motion("head").dq[YAW]) < 0.2 * SPEED
    assert run.motion("head").goal == goal


def test_only_the_owner_moves_an_attractor_and_within_the_limits(run: Stage) -> None:
    _, epoch = run.own("head", "gaze")
    run.tick()
    before = run.motion("head").goal
    follow(run, epoch - 1, 5)
    assert run.motion("head").goal == before
    refused_before = run.rig.stat("controller").rejected.get("limits", 0)
    run.rig.bus.publisher(Follow, "head").put(epoch=epoch, q=[2.0] * 6, dq=[0.0] * 6)
    wait_for(lambda: run.rig.stat("controller").rejected.get("limits", 0) > refused_before, "the refusal")
    assert run.motion("head").goal == before


def test_an_attractor_that_moves_ends_an_action(run: Stage) -> None:
    _, epoch = run.own("head", "gaze")
    run.goal("head", epoch, near("head"), "first")
    run.tick()
    assert run.motion("head").status == "moving"
    follow(run, epoch, 3)
    assert (run.motion("head").status, run.motion("head").action_id) == ("idle", "")


def test_everyone_may_take_a_part_from_a_behaviour_which_gets_it_back_when_it_is_free(run: Stage) -> None:
    gaze, epoch = run.own("head", "gaze")
    follow(run, epoch, 5)
    agent, _ = run.own("head", "agent_head")
    run.tick()
    assert run.motion("head").owner == "agent_head"
    goal = run.motion("head").goal
    follow(run, epoch, 5)  # of an ownership that has ended
    assert run.motion("head").goal == goal
    assert "agent_head" in refused("owned", lambda: run.take("head", gaze, "gaze"))
    run.leave("agent_head", agent)
    run.play(lambda: not run.motion("head").owner, "the free goal")
    newer = run.take("head", gaze, "gaze")
    assert newer is not None and newer > epoch


def test_precedence_is_by_name() -> None:
    assert may_take_from("agent_head", "gaze") and may_take_from("mobee_1", "gaze")
    assert not may_take_from("gaze", "agent_head")
    assert not may_take_from("gaze", "gaze") and not may_take_from("agent_head", "mobee_1")
