# SPDX-License-Identifier: Apache-2.0
"""When parts are held, and how they come under control again."""

from __future__ import annotations

import time

import numpy as np
import pytest

from bus_schema import VERSION, encode, encoding_of
from bus_schema.messages import EStop, Event
from tests.services.controller.stage import PARTS, ROBOT, Stage, near, refused
from tests.services.harness import wait_for


def publish_stop(run: Stage, stop: bool, src: str = "test", of_run: str = "another") -> None:
    header = {"v": VERSION, "run": of_run, "src": src, "seq": 0, "k": 0, "t": 0, "tw": 0}
    message = EStop(**header, set=stop, source="test", reason="test")
    run.rig.session.put(EStop.stream.key(), encode(message), encoding=encoding_of(EStop))


def test_a_stop_that_robot_sim_does_not_know_is_repeated_until_it_is_latched_and_ends_with_the_reset_of_the_gates(run: Stage) -> None:
    """robot_sim has died under the stop and has come back without a record; a message that says set = false releases nothing."""
    repeated = run.rig.record(EStop)
    run.ticks(30)
    publish_stop(run, True)
    run.ticks(30)
    run.sim.new_run()
    epochs = {part: gate.epoch for part, gate in run.sim.gates.items()}
    publish_stop(run, False)
    run.ticks(100)
    wait_for(lambda: any(stop.src == "controller" and stop.set for stop in repeated), "the repetition")
    assert {part: gate.epoch for part, gate in run.sim.gates.items()} == epochs
    assert {run.motion(part).status for part in ROBOT.parts} == {"held"}
    for gate in run.sim.gates.values():
        gate.state = "estop"
    run.ticks(5)
    count = len(repeated)
    run.ticks(30)
    assert len(repeated) - count <= 1  # one may have been on its way
    assert {run.motion(part).status for part in ROBOT.parts} == {"held"}
    for gate in run.sim.gates.values():
        gate.state = "hold"
    run.play(lambda: all(run.motion(part).status == "idle" for part in ROBOT.parts), "all parts to be armed", ticks=1000)


@pytest.mark.parametrize("shown", ["armed", "hold"])
def test_an_action_ends_at_a_stop_that_was_reset_before_the_next_tick(run: Stage, shown: str) -> None:
    """In a pause, after which the first tick shows the gates as they were before it, or while the controller was frozen."""
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm", 0.8), "stopped")
    run.ticks(30)
    assert run.motion("left_arm").status == "moving"
    publish_stop(run, True)
    publish_stop(run, True, "robot_sim", run.rig.bus.run)
    time.sleep(0.3)  # until both have arrived
    if shown == "hold":
        for part in PARTS:
            run.sim.hold(part)
    since, count = run.rig.bus.k, len(run.motions["left_arm"])
    run.tick()
    motion = run.motion("left_arm")
    assert (motion.status, motion.action_id) == ("held", "stopped")
    assert {order.mode for order in run.commands("left_arm", since)} <= {"hold"}
    for part in PARTS:
        run.sim.hold(part)
    run.play(lambda: {run.motion(part).status for part in PARTS} == {"idle"}, "all parts to be armed", ticks=1000)
    before = run.sim.of("left_arm").copy()
    run.ticks(50)
    np.testing.assert_allclose(run.sim.of("left_arm"), before, atol=1e-3)
    assert {motion.status for motion in run.motions["left_arm"][count:]} == {"held", "idle"}


def test_a_part_that_the_gate_drops_is_armed_again_at_rest_and_its_action_continues(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.goal("left_arm", epoch, near("left_arm", 0.8), "dropped")
    run.ticks(30)
    before = run.sim.gates["left_arm"].epoch
    run.sim.refuses_to_arm = {"left_arm"}
    run.sim.hold("left_arm")
    run.play(lambda: run.motion("left_arm").status == "suspended", "the hold", ticks=50)
    assert run.motion("left_arm").action_id == "dropped"
    refused("held", lambda: run.goal("left_arm", epoch, near("left_arm")))
    takes = len(run.sim.takes)
    run.play(lambda: run.sim.takes[takes:].count("left_arm") >= 2, "a second attempt after the first one failed", ticks=1000)
    assert {run.motion(p).status for p in ("torso", "right_arm")} == {"idle"}
    run.sim.refuses_to_arm = set()
    run.play(lambda: run.motion("left_arm").status == "moving", "the part to come back", ticks=1000)
    motion = run.motion("left_arm")
    gate = run.sim.gates["left_arm"]
    first = wait_for(lambda: [c for c in run.commands("left_arm") if c.epoch == gate.epoch], "its first command")[0]
    assert gate.epoch > before
    assert np.abs(first.ref).max() < 0.105  # rad/s, from rest: a tick at 600 deg/s^2
    np.testing.assert_allclose(motion.goal, near("left_arm", 0.8), atol=1e-12)
    assert run.numbers()["held_ticks"] > 0
    ended = run.play(lambda: (m := run.motion("left_arm")).status == "settled" and m, "the end of the action")
    assert ended.action_id == "dropped"
    run.goal("left_arm", epoch, near("left_arm"), "after")  # the goal's owner is still the same
    run.play(lambda: run.motion("left_arm").status == "settled", "the next action")


def test_while_one_part_waits_to_be_armed_the_others_get_their_commands(run: Stage) -> None:
    takes = len(run.sim.takes)
    run.sim.answers.clear()
    try:
        run.sim.hold("left_arm")
        since = run.rig.bus.k
        run.ticks(20)
        assert len(wait_for(lambda: len(run.commands("torso", since)) == 20 and run.commands("torso", since), "commands")) == 20
        assert run.motion("left_arm").status == "held"
    finally:
        run.sim.answers.set()
    run.play(lambda: run.motion("left_arm").status == "idle", "its return")
    assert len(run.sim.takes) - takes < 10  # a controller that waits for each answer asks anew every tick


def test_an_attempt_of_the_run_before_does_not_count(run: Stage) -> None:
    takes = len(run.sim.takes)
    run.sim.answers.clear()
    try:
        run.sim.hold("left_arm")
        run.play(lambda: len(run.sim.takes) > takes, "the attempt", ticks=1000)
        run.sim.new_run()
        run.sim.tick()
    finally:
        run.sim.answers.set()
    run.under_control()
    assert run.sim.takes[takes:].count("left_arm") == 2


def test_a_part_whose_state_stands_still_is_not_under_control(run: Stage) -> None:
    events = run.rig.record(Event, "controller")
    run.sim.silent = {"right_arm"}
    run.play(lambda: run.motion("right_arm").status == "held", "the hold", ticks=30)
    assert run.motion("torso").status == "idle"
    since = run.rig.bus.k
    run.ticks(5)
    assert run.commands("right_arm", since) == []
    wait_for(lambda: any("no fresh state" in e.text for e in events if e.code == "held"), "the event")


def test_a_new_run_resets_everything_except_the_owners_of_goals(run: Stage) -> None:
    _, epoch = run.own("left_arm")
    run.force("left_arm", epoch, f=[5.0] + [0.0] * 15)
    run.goal("left_arm", epoch, near("left_arm", 0.8), "old")
    run.ticks(40)
    takes = len(run.sim.takes)
    run.sim.new_run()
    assert run.rig.bus.k == 0
    run.under_control()
    motion = run.motion("left_arm")
    assert sorted(run.sim.takes[takes:]) == sorted(PARTS)
    assert (motion.action_id, motion.epoch) == ("", epoch)
    np.testing.assert_allclose(motion.goal, ROBOT.home[ROBOT.part("left_arm").slice], atol=1e-9)
    run.ticks(20)
    assert np.abs(run.motion("left_arm").dq).max() < 1e-6  # neither the old goal nor the old force
    run.goal("left_arm", epoch, near("left_arm"), "new")
