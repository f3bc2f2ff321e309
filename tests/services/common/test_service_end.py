# SPDX-License-Identifier: Apache-2.0
"""The end of a service, as a real process on a real bus: by a signal, by a call, and without its router or launcher."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from bus_schema import VERSION, keys
from bus_schema.messages import Clock, Event, WorldObject
from bus_schema.rpc import Done, Empty, Stat
from experiments.kit.live.launch import free_endpoint
from services.common import service as service_module
from services.common.config import ServiceConfig
from services.common.rpc import CallFailed
from services.common.service import Service
from services.launcher.child import Child
from services.launcher.child import Program as ChildProgram
from tests.services.common.probe_config import PROBE, ball
from tests.services.harness import QUICK_END, Program, Rig, rig, wait_for


def stat_of(who: str, instance: str) -> Stat:
    return Stat(v=VERSION, who=who, instance=instance, pid=1, uptime=0.0, ready=True, text="", numbers={}, rejected={})


def timed_end(program: Program, number: int = signal.SIGTERM) -> int:
    start = time.monotonic()
    code = program.stop(number)
    took = time.monotonic() - start
    print(f"ended {took:.2f} s after signal {number}")
    assert took < QUICK_END
    return code


def another(bus: Rig, *arguments: str) -> Program:
    return bus.run("probe", *PROBE, "--endpoint", bus.endpoint, *arguments)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_an_idle_service(bus: Rig, number: int) -> None:
    program = another(bus)
    mine = f"i{program.process.pid}_"
    assert timed_end(program, number) == 0
    wait_for(lambda: not any(i.startswith(mine) for i in bus.instances("probe")), "its token to go")


def test_a_shutdown_call_is_answered_and_obeyed(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as alone:
        program = another(alone)
        alone.call(keys.service_rpc("probe", "shutdown"), Empty, Done)
        assert program.wait() == 0


def test_a_signal_ends_a_service_that_waits_for_an_answer(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as alone:
        queries: list[Any] = []
        mute = alone.session.declare_queryable("mute/rpc/never", queries.append)
        program = another(alone)
        alone.call(keys.service_rpc("probe", "block"), Empty, Done)
        wait_for(lambda: "blocked" in program.says and queries, "the call")
        assert timed_end(program) == 0
        mute.undeclare()


def test_a_signal_ends_a_service_that_finds_no_router(bus: Rig) -> None:
    program = bus.spawn(*PROBE, "--endpoint", free_endpoint())
    wait_for(lambda: "connecting" in program.says, "its start")
    time.sleep(0.3)  # into its attempts, which say nothing
    assert program.is_running
    assert timed_end(program) == 0


def test_a_signal_ends_a_service_that_dials_a_silent_listener(bus: Rig) -> None:
    with socket.socket() as silent:
        silent.bind(("127.0.0.1", 0))
        silent.listen(5)
        program = bus.spawn(*PROBE, "--endpoint", f"tcp/127.0.0.1:{silent.getsockname()[1]}")
        silent.settimeout(20.0)
        connection, _ = silent.accept()
        assert timed_end(program) == 0
        connection.close()


def test_a_signal_ends_a_service_in_the_middle_of_a_flood(tmp_path: Path, bus: Rig) -> None:
    """Also what a flood may not do: keep calls from being answered, or fill the memory."""
    with rig(tmp_path, bus.robot) as alone:
        program = another(alone, "--inject_test_delay", "0.0002")
        clock = alone.bus.publisher(Clock)
        publisher = alone.bus.publisher(WorldObject, "ball")
        enough = threading.Event()

        def flood() -> None:
            while not enough.wait(0.001):
                for _ in range(20):
                    ball(publisher)
                clock.put(dt=10_000_000, mode="free", rate=1.0)

        sender = threading.Thread(target=flood)
        sender.start()
        try:
            wait_for(lambda: alone.stat("probe").rejected.get("flood", 0) > 100, "the inbox to be crowded")
            assert alone.stat("probe").numbers["objects"] > 100
            assert timed_end(program) == 0
        finally:
            enough.set()
            sender.join()


def test_two_signals_end_it_as_well_as_one(bus: Rig) -> None:
    program = another(bus)
    program.process.send_signal(signal.SIGTERM)
    program.process.send_signal(signal.SIGINT)
    assert timed_end(program) == 0


def test_a_signal_whose_exception_is_lost_ends_it_too(bus: Rig) -> None:
    program = another(bus)
    bus.call(keys.service_rpc("probe", "lose"), Empty, Done)
    assert timed_end(program) == 0


def test_an_error_in_a_handler_is_counted_reported_and_logged_and_the_process_continues(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as alone:
        program, events = another(alone), alone.record(Event, "probe")
        with pytest.raises(CallFailed, match="RuntimeError: the probe is broken") as caught:
            alone.call(keys.service_rpc("probe", "fail"), Empty, Done)
        assert caught.value.code == "handler"
        assert alone.stat("probe").rejected == {"handler": 1}
        wait_for(lambda: any("the probe is broken" in event.text for event in events), "the event")
        assert "Traceback" in program.says


def test_an_orphan_ends_with_code_3(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as parent:
        program = another(parent, "--orphaned", "0.5")
        parent.session.close()
        assert program.wait() == 3
        assert f"no router at {parent.endpoint} for 0.5 s" in program.says


def test_another_router_does_not_inherit_a_service(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as parent:
        program = another(parent)
        parent.serve(keys.service_rpc("launcher", "stat"), Empty, lambda request, key: stat_of("launcher", "usurper"))
        parent.token("router", "usurper")
        assert program.wait() == 3
        assert "another launcher answers" in program.says


def test_a_service_whose_launcher_died_during_its_start_does_not_join_the_next_system(tmp_path: Path, bus: Rig) -> None:
    """The new launcher may answer late: the service asks again until it does."""
    with rig(tmp_path, bus.robot) as parent:
        argv = (sys.executable, "-m", "tests.services.common.probe", "--endpoint", parent.endpoint)
        child = Child(ChildProgram("probe", argv, tmp_path / "probe.log"))
        child.spawn("i1_dead")
        try:
            child.release()  # as the end of the launcher does, which closes the pipe
            wait_for(lambda: parent.instances("probe"), "the service", 30.0)
            parent.serve(keys.service_rpc("launcher", "stat"), Empty, lambda request, key: stat_of("launcher", "rig"))
            assert child.process is not None and child.process.wait(10.0) == 3
            assert "another launcher answers" in (tmp_path / "probe.log").read_text()
        finally:
            child.kill()


@pytest.mark.parametrize("launcher_lives", [True, False])
def test_a_service_of_a_joined_host_ends_with_its_launcher_and_not_with_the_network(tmp_path: Path, bus: Rig, launcher_lives: bool) -> None:
    with rig(tmp_path, bus.robot) as parent:
        argv = (sys.executable, *PROBE, "--endpoint", parent.endpoint, "--orphaned", "0.5")
        child = Child(ChildProgram("probe", argv, tmp_path / "probe.log"))
        child.spawn(f"rig {os.getpid() if launcher_lives else 1}")
        try:
            child.release()
            wait_for(lambda: parent.instances("probe"), "the service", 30.0)
            parent.drop_token("router", "rig")
            if launcher_lives:
                time.sleep(2.5)
                assert child.running()
            else:
                assert child.process is not None and child.process.wait(10.0) == 3
                assert "no launcher at" in (tmp_path / "probe.log").read_text()
        finally:
            child.kill()


def test_other_tokens_of_a_router_end_nothing_and_cause_one_event_and_few_calls(tmp_path: Path, bus: Rig) -> None:
    asked: list[str] = []

    def answer(request: Empty, key: str) -> Stat:
        asked.append(key)
        return stat_of("launcher", "rig")

    with rig(tmp_path, bus.robot) as parent:
        program, events = another(parent), parent.record(Event, "probe")
        parent.serve(keys.service_rpc("launcher", "stat"), Empty, answer)
        for number in range(100):
            parent.token("router", f"stray{number}")
        wait_for(lambda: asked, "the question which launcher answers")
        time.sleep(0.5)
        assert program.is_running
        assert [event.code for event in events] == ["two_routers"] and len(asked) < 5


def test_without_a_router_it_gives_up_in_one_line_that_names_the_endpoint_and_the_remedy(bus: Rig) -> None:
    endpoint = free_endpoint()
    code = "import services.common.session as s, services.common.service as v, functools as f, tests.services.common.probe as p;"
    code += "v.open_client = f.partial(s.open_client, patience=0.5); p.main()"
    program = bus.spawn("-c", code, "--endpoint", endpoint)
    assert program.wait(20.0) == 1
    last = program.says.strip().splitlines()[-1]
    assert endpoint in last
    assert "mobee launch" in last
    assert "Traceback" not in program.says


def test_a_missing_robot_is_refused_in_one_line(bus: Rig) -> None:
    program = bus.spawn(*PROBE, "--endpoint", bus.endpoint, "--robot", "icup")
    assert program.wait(20.0) == 2
    assert "Did you mean 'icub'?" in program.says
    assert "Traceback" not in program.says


def test_a_service_that_was_busy_has_not_lost_its_router(bus: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """It computes for longer than a service may be without a router, and only then handles the router's token."""
    monkeypatch.setattr(service_module, "ORPHANED", 0.2)
    monkeypatch.setattr(service_module, "BUSY", 0.1)
    with Service("busy", ServiceConfig(endpoint=bus.endpoint), bus.robot) as service:
        time.sleep(0.5)
        service.check_router()
        service.spin(time.monotonic() + 0.05)
        service.check_router()
