# SPDX-License-Identifier: Apache-2.0
"""robot_sim in lockstep as a process: the test is the only participant."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from bus_schema import keys
from bus_schema.messages import Answer, Clock, Command, Commands, Event, Order, State, StepDone
from bus_schema.rpc import Done, Driven, Empty, Pace, Request, Take, Taken, WithEpoch
from mobee import load_robot
from services.common.rpc import CallFailed
from tests.services.harness import Rig, rig, wait_for

ROBOT = load_robot("icub")
TICK = 0.02  # s


@dataclass
class Bench:
    rig: Rig
    clocks: list[Clock]
    states: list[State]
    events: list[Event]
    answers: Any
    commands: Any
    all_commands: Any
    epoch: int = 0

    @property
    def k(self) -> int:
        return self.clocks[-1].k

    def done(self, k: int, **fields: Any) -> None:
        self.rig.bus.run, self.rig.bus.k = self.clocks[-1].run, k
        self.answers.put(re_k=k, **fields)

    def step(self) -> None:
        """Answer the tick; returns at the next."""
        k = self.k
        self.done(k)
        wait_for(lambda: self.k == k + 1, f"tick {k + 1}")

    def begin(self) -> None:
        wait_for(lambda: self.k == 0, "tick 0")
        self.step()

    def arm(self) -> None:
        self.rig.token("controller", "c1")
        self.epoch = self.rig.call(keys.drive("torso", "take"), Take, Taken, who="controller", instance="c1").epoch
        wait_for(self._is_armed, "robot_sim knows the token, and arms")

    def command(self, velocity: float, re_k: int) -> None:
        self.commands.put(epoch=self.epoch, re_k=re_k, mode="velocity", ref=[velocity, 0.0, 0.0], ttl=1000)

    def newest(self, k: int) -> State:
        return wait_for(lambda: next((s for s in self.states if s.k == k), None), f"state {k}")

    def hears(self, code: str, says: str) -> None:
        """An event of that kind in this run; one of the run before may come late."""

        def is_heard() -> bool:
            run = self.clocks[-1].run
            return any(event.code == code and event.run == run and says in event.text for event in list(self.events))

        wait_for(is_heard, f"the event {code}: {says}")

    def _is_armed(self) -> bool:
        try:
            return bool(self.rig.call(keys.drive("torso", "arm"), WithEpoch, Driven, epoch=self.epoch).gate == "armed")
        except CallFailed as refused:
            if refused.code != "no_token":  # tokens and calls come by different paths
                raise
            return False

    def stat(self) -> dict[str, float]:
        return self.rig.stat("robot_sim").numbers


@contextmanager
def robot_sim(folder: Path, *participants: str) -> Iterator[Bench]:
    with rig(folder, ROBOT) as made:
        made.bus.who = "controller"
        clocks = made.record(Clock)
        states, events = made.record(State, "torso"), made.record(Event, "robot_sim")
        answers = made.bus.publisher(StepDone, "controller")
        commands = made.bus.publisher(Command, "torso")
        all_commands = made.bus.publisher(Commands, delivery="STEP")
        made.token("launcher", "l1")
        flags = ("--backend", "kinematic", "--rate", "50", "--mode", "lock", "--participants", *participants, "--encoder-noise", "0.0")
        made.start("services.robot_sim", "robot_sim", *flags)
        yield Bench(made, clocks, states, events, answers, commands, all_commands)


@pytest.fixture(scope="module")
def started(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    with robot_sim(tmp_path_factory.mktemp("robot_sim"), "controller") as made:
        yield made


@pytest.fixture
def bench(started: Bench) -> Iterator[Bench]:
    """At tick 0 of a new run."""
    wait_for(lambda: started.clocks, "a first run")
    before = started.clocks[-1].run
    started.rig.call(keys.sim("reset"), Empty, Done)
    run = wait_for(lambda: next((clock.run for clock in started.clocks if clock.run != before), None), "a new run")
    started.clocks[:] = [clock for clock in started.clocks if clock.run == run]
    started.states[:] = [state for state in started.states if state.run == run]
    started.events.clear()
    yield started
    if started.rig.holds("controller", "c1"):
        started.rig.drop_token("controller", "c1")


def test_tick_0_is_repeated_until_answered_and_then_each_tick_waits(bench: Bench) -> None:
    wait_for(lambda: len(bench.clocks) >= 3, "tick 0 again")
    assert {clock.k for clock in bench.clocks} == {0}
    assert bench.rig.stat("robot_sim").text.endswith("waits for controller")
    bench.begin()
    time.sleep(0.3)
    assert bench.k == 1
    bench.step()
    assert (bench.k, bench.clocks[-1].mode, bench.clocks[-1].t) == (2, "lock", 40_000_000)


def test_a_pace_lets_each_tick_take_its_time_at_least(bench: Bench) -> None:
    bench.rig.call(keys.sim("pace"), Pace, Done, speed=0.5)  # 40 ms a tick
    try:
        bench.begin()
        begin = time.monotonic()
        for _ in range(10):
            bench.step()
        assert time.monotonic() - begin > 0.3
    finally:
        bench.rig.call(keys.sim("pace"), Pace, Done, speed=0.0)


@pytest.mark.parametrize("verb, request_type, fields", [("pace", Pace, {"speed": 0.0}), ("reset", Empty, {})])
def test_a_new_pace_or_run_does_not_wait_for_the_end_of_a_long_tick(
    bench: Bench, verb: str, request_type: type[Request], fields: dict[str, float]
) -> None:
    bench.begin()
    bench.rig.call(keys.sim("pace"), Pace, Done, speed=1e-9)
    try:
        bench.done(1)
        wait_for(lambda: bench.stat()["speed"] > 0.0, "the answer, after which the tick lasts on")
        run = bench.clocks[-1].run
        bench.rig.call(keys.sim(verb), request_type, Done, **fields)
        wait_for(lambda: bench.k == 2 or bench.clocks[-1].run != run, "the next tick")
    finally:
        bench.rig.call(keys.sim("pace"), Pace, Done, speed=0.0)


def test_calls_are_answered_while_no_service_takes_part(tmp_path: Path) -> None:
    with robot_sim(tmp_path) as bench:
        wait_for(lambda: bench.stat()["tick"] > 0, "a tick")


def test_a_command_acts_in_the_tick_after_the_one_it_answers(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    bench.command(0.1, re_k=1)
    bench.step()
    assert [bench.newest(k).cmd_age for k in (1, 2)] == [-1, 1]
    bench.step()
    assert bench.newest(3).q[0] == bench.newest(2).q[0]  # what moves in tick 2 waits in the motors' delay
    for k in range(3, 9):
        bench.command(0.1, re_k=k)
        bench.step()
    assert bench.newest(9).q[0] > bench.newest(2).q[0]
    assert bench.newest(9).t == round(9 * TICK * 1e9)


def test_commands_of_one_tick_are_admitted_once_each(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    head = bench.rig.call(keys.drive("head", "take"), Take, Taken, who="controller", instance="c1").epoch
    bench.rig.call(keys.drive("head", "arm"), WithEpoch, Driven, epoch=head)
    heads, to_head = bench.rig.record(State, "head"), bench.rig.bus.publisher(Command, "head")
    refused = bench.rig.stat("robot_sim").rejected
    for _ in range(8):
        k = bench.k
        bench.command(0.1, re_k=k)
        to_head.put(epoch=head, re_k=k, mode="velocity", ref=[0.1] + 5 * [0.0], ttl=1000)
        bench.step()
    wait_for(lambda: heads[-1].k == bench.k, "the state of the head")
    assert bench.newest(bench.k).cmd_age == heads[-1].cmd_age == 1
    assert bench.newest(bench.k).q[0] > bench.newest(2).q[0] and heads[-1].q[0] > heads[0].q[0]
    assert bench.rig.stat("robot_sim").rejected == refused


def test_commands_to_several_parts_also_answer_the_tick(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    k = bench.k
    ref = [0.0] * len(ROBOT.motors)
    ref[ROBOT.part("torso").start] = 0.1
    bench.rig.bus.run = bench.clocks[-1].run
    orders = {"torso": Order(bench.epoch, "velocity")}
    bench.all_commands.put(re_k=k, parts=orders, ref=ref, ttl=1000, answer=Answer(True, [], []))
    wait_for(lambda: bench.k == k + 1, "the next tick")
    assert (bench.newest(k + 1).cmd_age, bench.newest(k + 1).mode) == (1, "velocity")


def test_commands_to_a_part_that_is_not_there_are_refused_whole(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    bench.rig.bus.run = bench.clocks[-1].run
    orders = {"torso": Order(bench.epoch, "velocity"), "tail": Order(1, "velocity")}
    bench.all_commands.put(re_k=bench.k, parts=orders, ref=[0.0] * len(ROBOT.motors), ttl=1000, answer=None)
    bench.step()
    assert bench.newest(bench.k).mode == "hold"
    assert bench.rig.stat("robot_sim").rejected["part"] == 1


def test_a_command_is_in_force_for_three_ticks_however_long_they_take(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    bench.command(0.1, re_k=1)
    for _ in range(3):
        time.sleep(0.15)
        bench.step()
    assert [bench.newest(k).cmd_age for k in (2, 3, 4)] == [1, 2, 3]
    bench.step()
    assert (bench.newest(5).gate, bench.newest(5).mode) == ("hold", "hold")
    bench.hears("hold", "no valid command for 4 ticks")


def test_a_late_participant_is_dropped_its_parts_hold_and_the_run_is_marked(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    bench.command(0.1, re_k=1)
    begin = time.monotonic()
    bench.step()
    assert bench.stat()["flaws"] == 0.0
    wait_for(lambda: bench.k >= 12, "ticks without an answer")
    assert time.monotonic() - begin > 2.0 + 8 * TICK  # at the pace of the clock on the wall
    assert bench.newest(3).gate == "hold"
    assert bench.stat()["flaws"] == 1.0
    bench.hears("not_repeatable", "controller did not answer tick 2 within 2 s")

    def is_waited_for() -> bool:
        """It counts again: after an answer no tick begins without the next."""
        bench.done(bench.k)
        time.sleep(0.2)
        before = bench.stat()["tick"]
        time.sleep(0.3)
        return bench.stat()["tick"] == before

    wait_for(is_waited_for, "a tick that waits")


@pytest.mark.parametrize("late, gate", [("model", "hold"), ("agent_head", "armed")])
def test_all_parts_hold_if_a_service_is_late_that_the_whole_robot_needs(tmp_path: Path, late: str, gate: str) -> None:
    others = {"model", "agent_head"}
    with robot_sim(tmp_path, "controller", *others) as bench:
        wait_for(lambda: bench.clocks, "tick 0")
        bench.done(0, including=sorted(others))
        wait_for(lambda: bench.k == 1, "tick 1")
        bench.arm()
        bench.command(0.1, re_k=1)
        bench.done(1, including=sorted(others - {late}))
        assert bench.newest(2).gate == gate
        bench.hears("not_repeatable", f"{late} did not answer tick 1 within 2 s")
        if gate == "hold":
            bench.hears("hold", "model is late")


def test_a_command_that_waits_when_a_new_run_begins_is_dropped(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    rejected = bench.rig.stat("robot_sim").rejected
    run = bench.clocks[-1].run
    bench.command(0.1, re_k=1)
    bench.rig.call(keys.sim("reset"), Empty, Done)  # by another path: the command is there before the answer to the first tick
    wait_for(lambda: bench.clocks[-1].run != run and bench.k == 0, "a new run")
    bench.begin()
    bench.step()
    assert bench.rig.stat("robot_sim").rejected == rejected
    assert bench.newest(bench.k).gate == "idle"


def test_a_participant_that_has_ended_is_not_waited_for(bench: Bench) -> None:
    bench.begin()
    bench.arm()
    bench.rig.drop_token("controller", "c1")
    wait_for(lambda: bench.k >= 3, "ticks without it")
    bench.hears("not_repeatable", "controller is gone")  # a participant that was awaited would be reported as late


def test_a_reset_begins_a_new_run_at_tick_0(bench: Bench) -> None:
    bench.begin()
    bench.step()
    before = bench.clocks[-1].run
    bench.rig.call(keys.sim("reset"), Empty, Done)
    wait_for(lambda: bench.clocks[-1].run != before, "a new run")
    assert bench.k == 0
    bench.begin()
    assert (bench.k, bench.stat()["flaws"]) == (1, 0.0)


def test_the_hash_is_that_of_the_states_and_of_nothing_else(bench: Bench) -> None:
    def states_of(ticks: int) -> str:
        wait_for(lambda: bench.k == 0, "tick 0")
        for _ in range(ticks):
            bench.step()
        return bench.rig.stat("robot_sim").words["states"]

    first = states_of(3)
    bench.rig.call(keys.sim("reset"), Empty, Done)
    assert states_of(3) == first
    bench.step()
    assert bench.rig.stat("robot_sim").words["states"] != first
