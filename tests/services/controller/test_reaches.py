# SPDX-License-Identifier: Apache-2.0
"""A reach pulls a marker to its target and then ends its force."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import Event, Follow, Reach, Targets
from bus_schema.rpc import ReachFor, Started
from mobee import Model
from mobee.arrays import Array
from services.common.rpc import CallFailed
from tests.services.controller.stage import PARTS, ROBOT, SETTLE, Stage, near, refused
from tests.services.harness import wait_for

MODEL = Model(ROBOT)
ARM = ROBOT.part("right_arm").slice


def palm(q: Array) -> Array:
    return MODEL.evaluate(q).position("right_palm")


def reach(stage: Stage, epoch: int, position: Array, action: str = "r", **how: Any) -> Started:
    at = [float(x) for x in position]
    asked = {"marker": "right_palm", "object": "thing", "position": at, "radius": 0.05, "aim": "centre", "action_id": action, **how}
    return stage.rig.call(keys.goal("right_arm", "reach"), ReachFor, Started, epoch=epoch, **asked)


@pytest.fixture
def reports(run: Stage) -> list[Reach]:
    return run.rig.record(Reach, "right_arm")


def newest(reports: list[Reach]) -> Reach | None:
    return reports[-1] if reports else None


def phase(reports: list[Reach]) -> str:
    return reports[-1].phase if reports else ""


def test_a_reach_is_drawn_to_its_target_and_back_and_settles_twice(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    before, at = run.sim.q[ARM].copy(), palm(run.sim.q)
    target = at + [-0.03, 0.02, 0.05]
    run.model.touched = {"right_arm": ["thing"]}
    started = reach(run, epoch, target)
    run.play(lambda: phase(reports) == "returning", "the force's end")
    end = next(one for one in reports if one.phase == "returning")
    assert (end.action_id, end.marker, end.object, end.touched, end.settled) == ("r", "right_palm", "thing", ["thing"], True)
    assert (end.end_k - started.k) * 0.01 >= SETTLE.first_check
    assert end.missing == pytest.approx(np.linalg.norm(np.array(end.position) - target))
    assert end.missing < np.linalg.norm(at - target)
    assert run.motion("right_arm").status == "moving"
    drawn = np.abs(np.array(end.q) - before).max()
    run.play(lambda: phase(reports) == "over", "the return")
    motion = run.motion("right_arm")
    assert (motion.status, motion.action_id, motion.start_k) == ("settled", "r", started.k)
    assert (motion.since_k - end.end_k) * 0.01 >= SETTLE.first_check
    assert np.abs(np.array(motion.q) - before).max() < 0.3 * drawn
    np.testing.assert_allclose(motion.goal, before, atol=1e-15)  # the attractor has not moved
    assert (reports[-1].q, reports[-1].position) == (end.q, end.position)


def test_in_a_pause_a_goal_waits_and_reaches_and_forces_are_refused(run: Stage, reports: list[Reach]) -> None:
    (_, left), (_, right) = run.own("left_arm"), run.own("right_arm", "agent_right_arm")
    for part in PARTS:
        run.sim.hold(part)
    run.sim.tick(mode="paused")
    wait_for(lambda: is_paused(run, left), "the pause")
    assert "resume it" in refused("paused", lambda: reach(run, right, palm(run.sim.q)))
    run.force("left_arm", left)  # clearing is always right
    run.goal("left_arm", left, near("left_arm"), "later")
    run.play(lambda: run.motion("left_arm").status == "moving" and run.motion("right_arm").status == "idle", "the end of the hold")
    assert run.motion("left_arm").action_id == "later"
    reach(run, right, palm(run.sim.q) + [-0.03, 0.02, 0.05])
    run.play(lambda: phase(reports) == "returning", "the force's end")


def is_paused(stage: Stage, epoch: int) -> bool:
    try:
        stage.force("left_arm", epoch, f=[0.0] * 16)
    except CallFailed as refusal:
        return refusal.code == "paused"
    return False


def test_a_reach_that_is_to_stay_ends_where_its_force_does(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    started = reach(run, epoch, palm(run.sim.q) + [-0.03, 0.02, 0.05], stay=True)
    run.play(lambda: phase(reports) == "over", "the end")
    motion = run.motion("right_arm")
    assert (motion.status, motion.start_k) == ("settled", started.k)
    assert motion.goal == reports[-1].q
    before = palm(run.sim.q)
    run.ticks(100)
    np.testing.assert_allclose(palm(run.sim.q), before, atol=0.01)


def test_it_follows_its_target_where_the_model_has_it(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    at = palm(run.sim.q)
    there = at + [-0.02, 0.03, 0.04]
    reach(run, epoch, at)
    targets = run.rig.bus.publisher(Targets)
    run.ticks(3)
    targets.put(re_k=run.rig.bus.k, positions={"another": [1.0, 1.0, 1.0]})
    targets.put(re_k=run.rig.bus.k, positions={"thing": [1e200, 0.0, 0.0]})
    run.ticks(3)
    assert reports[-1].target == at.tolist()
    targets.put(re_k=run.rig.bus.k, positions={"thing": there.tolist()})
    run.play(lambda: reports[-1].target == there.tolist(), "the move", ticks=10)
    run.play(lambda: phase(reports) == "returning", "the force's end")
    assert np.linalg.norm(np.array(reports[-1].position) - there) < 0.8 * np.linalg.norm(at - there)


def test_a_reach_ends_when_its_target_is_gone(run: Stage, reports: list[Reach]) -> None:
    events = run.rig.record(Event, "controller")
    _, epoch = run.own("right_arm")
    targets = run.rig.bus.publisher(Targets)
    at = palm(run.sim.q)
    reach(run, epoch, at + [-0.1, 0.1, 0.3])
    run.play(lambda: reports and np.abs(run.motion("right_arm").dq).max() > 0.05, "its motion", ticks=200)
    targets.put(re_k=run.rig.bus.k, positions={}, gone=["another"])
    run.ticks(3)
    assert phase(reports) == "reaching"
    targets.put(re_k=run.rig.bus.k, positions={}, gone=["thing"])
    run.play(lambda: phase(reports) == "interrupted", "the end", ticks=10)
    wait_for(lambda: [e for e in events if e.code == "target_gone"], "the event")
    run.play(lambda: run.motion("right_arm").status == "settled", "the return")
    np.testing.assert_allclose(palm(run.sim.q), at, atol=0.02)


def test_a_reach_ends_without_outcome_in_hold_by_another_goal_or_attractor_and_with_its_owner(run: Stage, reports: list[Reach]) -> None:
    instance, epoch = run.own("right_arm")
    far = palm(run.sim.q) + [-0.1, 0.1, 0.3]

    def begin(action: str) -> None:
        reach(run, epoch, far, action)
        run.play(
            lambda: reports and reports[-1].action_id == action and np.abs(run.motion("right_arm").dq).max() > 0.05, "its motion", ticks=200
        )

    begin("held")
    run.sim.hold("right_arm")
    run.play(lambda: phase(reports) == "interrupted", "the end by a hold", ticks=20)
    run.play(lambda: run.motion("right_arm").status == "idle", "its return")
    run.ticks(30)
    assert np.abs(run.motion("right_arm").dq).max() < 0.01

    begin("replaced")
    run.goal("right_arm", epoch, near("right_arm"), "goal")
    wait_for(lambda: phase(reports) == "interrupted", "the end by a goal")
    run.play(lambda: run.motion("right_arm").status == "settled", "the goal")
    assert run.motion("right_arm").action_id == "goal"

    begin("followed")
    run.rig.bus.publisher(Follow, "right_arm").put(epoch=epoch, q=run.sim.of("right_arm").tolist(), dq=[0.0] * 16)
    run.play(lambda: phase(reports) == "interrupted", "the end by an attractor that moves", ticks=20)
    assert (run.motion("right_arm").status, run.motion("right_arm").action_id) == ("idle", "")

    begin("owner")
    run.leave("agent_test", instance)
    wait_for(lambda: phase(reports) == "interrupted", "the end with its owner")
    run.ticks(60)
    assert (run.motion("right_arm").status, run.motion("right_arm").epoch) == ("idle", 0)
    assert np.abs(run.motion("right_arm").dq).max() < 0.02


def test_other_forces_come_and_go_while_it_reaches(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    _, other = run.own("left_arm", "agent_left_arm")
    at = palm(run.sim.q)
    target = at + [-0.03, 0.02, 0.05]
    reach(run, epoch, target)
    run.force("left_arm", other, f=[1.0] + [0.0] * 15)
    run.ticks(5)
    run.force("left_arm", other)
    run.play(lambda: phase(reports) == "returning", "the force's end")
    assert reports[-1].missing < 0.8 * np.linalg.norm(at - target)


def test_an_invalid_reach_is_refused_with_the_valid_values(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    here = palm(run.sim.q)
    assert "Did you mean 'right_palm'?" in refused("reach", lambda: reach(run, epoch, here, marker="right_plam"))
    assert "right_arm cannot reach with left_palm" in refused("reach", lambda: reach(run, epoch, here, marker="left_palm"))
    assert "normal" in refused("reach", lambda: reach(run, epoch, here, normal=[0.0, 0.0, 0.0]))
    assert "within 1000 m" in refused("reach", lambda: reach(run, epoch, [1e200, 0.0, 0.0]))
    refused("value", lambda: reach(run, epoch, [np.nan, 0.0, 0.0]))
    refused("epoch", lambda: reach(run, epoch - 1, here))
    refused("decode", lambda: reach(run, epoch, here, radius=0.0))
    assert (reports, run.motion("right_arm").status) == ([], "idle")


def test_its_first_command_does_not_wait_for_the_next_tick(run: Stage, reports: list[Reach]) -> None:
    _, epoch = run.own("right_arm")
    run.ticks(3)
    k = run.rig.bus.k
    before = run.commands("right_arm", since=k - 1)
    others = run.commands("left_arm", since=k - 1)
    assert len(before) == 1
    reach(run, epoch, palm(run.sim.q) + [-0.1, 0.1, 0.3])
    amended = wait_for(lambda: run.commands("right_arm", since=k - 1)[1:], "a second command")
    assert (len(amended), amended[0].re_k, run.rig.bus.k) == (1, k, k)
    assert np.abs(np.array(amended[0].ref) - before[0].ref).max() > 5e-3
    assert run.commands("left_arm", since=k - 1)[1].ref == others[0].ref
    run.tick()
    assert len(run.commands("right_arm", since=k)) == 1
