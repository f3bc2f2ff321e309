# SPDX-License-Identifier: Apache-2.0
"""Position and torque; stop, pause and reset."""

from __future__ import annotations

import logging
import re
import time

import numpy as np
import pytest

from bus_schema import keys
from bus_schema.messages import EStop, Tick
from bus_schema.rpc import Done, Driven, Empty, Reply, Request, Take, Taken, WithEpoch
from mobee.model.masses import gravity_torque
from mobee_cli.__main__ import main
from services.common.bus import Bus
from services.common.rpc import CallFailed
from tests.services.harness import wait_for
from tests.services.robot_sim.bench import DT, ELBOW, ROBOT, Bench, elbow


def stop(bench: Bench, reason: str) -> None:
    """Stop the robot as a client does: the message is repeated, because a busy machine may drop it."""
    publisher, again = bench.rig.bus.publisher(EStop), 0.0

    def is_obeyed() -> bool:
        nonlocal again
        if (now := time.monotonic()) >= again:
            again = now + 1.0
            publisher.put(set=True, source="test", reason=reason)
        return all(bench.newest(part).gate == "estop" for part in ROBOT.parts)

    wait_for(is_obeyed, "the stop")


def test_position_mode_goes_where_the_reference_goes(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    state = {"q": list(bench.newest("left_arm").q)}
    start = state["q"][ELBOW]

    def reference() -> list[float]:
        if state["q"][ELBOW] > start - 0.2:
            state["q"][ELBOW] -= 0.3 * DT
        return state["q"]

    bench.keep("left_arm", epoch, 1.6, reference, mode="position")
    reached = bench.next_state("left_arm")
    assert reached.mode == "position"
    assert reached.q[ELBOW] == pytest.approx(state["q"][ELBOW], abs=0.02)


def test_torque_mode_accelerates_a_motor(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    arm = ROBOT.part("left_arm").slice

    def carry_and_bend() -> list[float]:
        q = ROBOT.home.copy()
        q[arm] = bench.newest("left_arm").q
        return (gravity_torque(ROBOT, q)[arm] + elbow(1.0)).tolist()

    state = bench.keep("left_arm", epoch, 1.0, carry_and_bend, mode="torque")
    assert state.mode == "torque"
    assert state.dq[ELBOW] == pytest.approx(1.0 / 5.0, abs=0.02)  # where friction, 5 N m s/rad, balances it
    assert state.tau[ELBOW] == pytest.approx(1.0, abs=0.1)


def test_an_emergency_stop_latches_until_it_is_reset(bench: Bench) -> None:
    stops = bench.rig.record(EStop)
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.3))
    stop(bench, "because")
    assert re.match("emergency stop by test since .*: because; kinematic", bench.rig.stat("robot_sim").text)
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "estop"
    wait_for(lambda: sum(stop.src == "robot_sim" for stop in stops) >= 3, "its repetition")
    assert min(np.diff([stop.tw for stop in stops if stop.src == "robot_sim"])) < 5e8  # ns
    assert abs(bench.next_state("left_arm").dq[ELBOW]) < 0.01
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)
    assert bench.next_state("left_arm").gate == "hold"
    bench.hears("estop_reset", 0, "emergency stop reset by test")
    wait_for(lambda: any(stop.src == "robot_sim" and not stop.set for stop in tuple(stops)), "the release, for observers")
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    time.sleep(0.25)
    assert bench.next_state("torso").gate == "hold"


def test_while_it_is_paused_no_time_passes_and_afterwards_it_holds(bench: Bench) -> None:
    ticks = bench.rig.record(Tick)
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.1, lambda: elbow(0.3))
    bench.rig.call(keys.sim("pause"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "paused", "the pause")
    shown = wait_for(lambda: next((tick for tick in tuple(ticks) if tick.mode == "paused"), None), "its tick").parts["left_arm"]
    assert (shown.gate, shown.mode, shown.epoch, shown.cmd_seq, shown.cmd_age) == ("hold", "hold", epoch, -1, -1)
    k = bench.clocks[-1].k
    time.sleep(0.1)
    assert bench.clocks[-1].k == k
    bench.rig.call(keys.sim("resume"), Empty, Done)
    assert bench.next_state("left_arm").gate == "hold"
    wait_for(lambda: bench.clocks[-1].mode == "free", "the clock")


def test_an_emergency_stop_is_obeyed_in_a_pause_although_no_tick_begins(bench: Bench) -> None:
    stops, delays = bench.rig.record(EStop), []
    bench.rig.call(keys.sim("pause"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "paused", "the pause")
    for _ in range(5):
        stops.clear()
        said = time.monotonic_ns()
        bench.rig.bus.publisher(EStop).put(set=True, source="test", reason="because")
        wait_for(lambda: any(stop.src == "robot_sim" and stop.set for stop in tuple(stops)), "the stop")
        delays.append(next(stop.tw for stop in stops if stop.src == "robot_sim") - said)
        bench.rig.call(keys.ESTOP_RESET, Empty, Done)
    bench.rig.call(keys.sim("resume"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "free", "the clock")
    assert np.median(delays) < 2e8  # ns, by robot_sim's clock


def test_an_emergency_stop_in_a_pause_is_confirmed_to_mobee_estop(bench: Bench, capsys: pytest.CaptureFixture[str]) -> None:
    bench.rig.call(keys.sim("pause"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "paused", "the pause")
    assert main(["estop", "--endpoint", bench.rig.endpoint, "--reason", "in a pause"]) == 0
    assert capsys.readouterr().out.startswith("stopped: all parts, as robot_sim confirms")
    assert bench.rig.stat("robot_sim").text.startswith("emergency stop by mobee")
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)
    bench.rig.call(keys.sim("resume"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].mode == "free", "the clock")


def test_only_the_client_that_paused_can_resume_or_reset_while_it_runs(bench: Bench) -> None:
    def is_refused(verb: str) -> bool:
        bench.rig.call(keys.sim("pause"), Empty, Done, who="person")
        try:
            bench.rig.call(keys.sim(verb), Empty, Done, who="another")
        except CallFailed as failed:
            assert failed.code == "owned"
            return True
        bench.rig.call(keys.sim("resume"), Empty, Done, who="another")
        return False

    bench.rig.token("person", "p1")
    wait_for(lambda: is_refused("resume"), "the token of the first is known, and another refused")
    assert is_refused("pause")
    assert is_refused("reset")
    assert "paused by person, for at most" in bench.rig.stat("robot_sim").text
    bench.rig.drop_token("person", "p1")

    def resumed() -> bool:
        try:
            return bool(bench.rig.call(keys.sim("resume"), Empty, Done, who="another"))
        except CallFailed:
            return False

    wait_for(resumed, "the resumption by another, once the first has ended")
    wait_for(lambda: bench.clocks[-1].mode == "free", "the clock")


def test_a_reset_is_a_new_run_at_home_without_owners(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bench.keep("left_arm", epoch, 0.4, lambda: elbow(0.6))
    run = bench.clocks[-1].run
    bench.rig.call(keys.sim("reset"), Empty, Done)
    bench.follow()
    assert bench.clocks[-1].run != run
    state = bench.next_state("left_arm")
    assert state.run == bench.clocks[-1].run
    assert state.gate == "idle"
    home = ROBOT.home[ROBOT.part("left_arm").slice]
    assert state.q == pytest.approx(home, abs=0.02)
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "epoch"
    assert bench.take("left_arm") > epoch


def test_a_latched_stop_outlives_a_reset(bench: Bench) -> None:
    stop(bench, "because")
    bench.rig.call(keys.sim("reset"), Empty, Done)
    bench.follow()
    assert {bench.next_state(part).gate for part in ROBOT.parts} == {"estop"}
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)
    assert {bench.next_state(part).gate for part in ROBOT.parts} == {"hold"}


def test_its_own_repetition_is_no_new_stop_whatever_run_it_was_sent_in(bench: Bench) -> None:
    runs = [bench.clocks[-1].run]
    bench.rig.call(keys.sim("reset"), Empty, Done)
    bench.follow()
    runs.append(bench.clocks[-1].run)
    own = Bus(bench.rig.session, "robot_sim", logging.getLogger("rig"))
    for own.run in runs:
        own.publisher(EStop).put(set=True, source="test", reason="of before")
    time.sleep(0.2)
    assert {bench.next_state(part).gate for part in ROBOT.parts} == {"idle"}
    own.run = "run_of_another_process"
    own.publisher(EStop).put(set=True, source="test", reason="of another")
    wait_for(lambda: all(bench.newest(part).gate == "estop" for part in ROBOT.parts), "the stop")
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)


def test_a_stop_soon_after_a_reset_is_repeated_as_often_as_any(bench: Bench) -> None:
    stops = bench.rig.record(EStop)
    for n in range(6):
        stop(bench, f"number {n}")
        bench.rig.call(keys.ESTOP_RESET, Empty, Done)
        wait_for(lambda: all(bench.newest(part).gate != "estop" for part in ROBOT.parts), "the reset")
    stop(bench, "the last")
    wait_for(lambda: any(stop.src == "robot_sim" and stop.reason == "the last" for stop in tuple(stops)), "its repetition")
    before = len(stops)
    time.sleep(1.0)
    assert 1 <= len(stops) - before <= 20  # ten a second
    bench.rig.call(keys.ESTOP_RESET, Empty, Done)


@pytest.mark.parametrize("verb, request_type, reply", [("take", Take, Taken), ("hold", WithEpoch, Driven)])
def test_a_part_that_the_robot_has_not_is_refused_by_name(bench: Bench, verb: str, request_type: type[Request], reply: type[Reply]) -> None:
    fields = {"instance": "c1"} if verb == "take" else {"epoch": 1}
    with pytest.raises(CallFailed, match="no part 'tail'; this robot has torso, head, left_arm, right_arm") as caught:
        bench.rig.call(keys.drive("tail", verb), request_type, reply, who="controller", **fields)
    assert caught.value.code == "part"
