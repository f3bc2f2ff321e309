# SPDX-License-Identifier: Apache-2.0
"""The life of a service, as a real process on a real bus: its answers, its refusals, and its end."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zenoh

from bus_schema import VERSION, decode, encode, encoding_of, keys
from bus_schema.messages import Clock, Decision, Event, Forces, Geometry, WorldObject
from bus_schema.rpc import Config, Done, Empty, Failure, Stat, Take, Taken
from experiments.kit.live.launch import free_endpoint
from services.common import rpc
from services.common import service as service_module
from services.common.bus import NO_RUN, Bus
from services.common.config import ServiceConfig
from services.common.rpc import CallFailed
from services.common.service import Service
from services.launcher.child import Child
from services.launcher.child import Program as ChildProgram
from tests.services.harness import QUICK_END, Program, Rig, rig, wait_for

PROBE = ("-m", "tests.services.common.probe")


@pytest.fixture(scope="module")
def probe(bus: Rig) -> Program:
    return bus.run("probe", *PROBE, "--endpoint", bus.endpoint, "--seed", "5")


@pytest.fixture
def clock(bus: Rig, probe: Program) -> Iterator[Any]:
    """Ticks of the rig's run; the probe knows it when the fixture is there."""
    publisher = bus.bus.publisher(Clock)

    def tick() -> int:
        bus.bus.k += 1
        publisher.put(dt=10_000_000, mode="free", rate=1.0)
        wait_for(lambda: numbers(bus)["k"] == bus.bus.k, "the tick")
        return bus.bus.k

    tick()
    yield tick


def stat_of(who: str, instance: str) -> Stat:
    return Stat(v=VERSION, who=who, instance=instance, pid=1, uptime=0.0, ready=True, text="", numbers={}, rejected={})


def numbers(bus: Rig) -> dict[str, float]:
    return bus.stat("probe").numbers


def rejected(bus: Rig) -> dict[str, int]:
    return bus.stat("probe").rejected


def ball(publisher: Any, name: str = "ball") -> None:
    publisher.put(
        name=name,
        geometry=Geometry(kind="sphere", size=[0.03]),
        position=[0.0, 0.0, 0.0],
        quaternion=[1.0, 0.0, 0.0, 0.0],
        covariance=[0.0] * 9,
        role="target",
        t_capture=0,
        valid_until=0,
    )


def send(bus: Rig, key: str, request: Any, attachment: str | None = None) -> list[tuple[bool, bytes, str]]:
    """A call by hand: (ok, payload, encoding) of every answer."""
    found = []
    how: dict[str, Any] = {"encoding": encoding_of(type(request)), "attachment": attachment, "timeout": 10.0}
    for answer in bus.session.get(key, payload=encode(request), **how):
        part = answer.ok if answer.ok is not None else answer.err
        found.append((answer.ok is not None, part.payload.to_bytes(), str(part.encoding)))
    return found


# What every service answers


def test_stat_has_name_and_status_of_the_service(bus: Rig, probe: Program) -> None:
    stat = bus.stat("probe")
    assert (stat.who, stat.pid, stat.ready, stat.text) == ("probe", probe.process.pid, True, "a probe")
    assert {stat.instance} == bus.instances("probe")
    assert stat.uptime > 0


def test_config_is_the_whole_configuration(bus: Rig, probe: Program) -> None:
    config = json.loads(bus.call(keys.service_rpc("probe", "config"), Empty, Config).config)
    assert (config["seed"], config["endpoint"], config["gains"]) == (5, bus.endpoint, "default")


def test_mark_zeroes_the_counters(bus: Rig, clock: Any) -> None:
    bus.session.put(Forces.stream.key("model"), b"nonsense", encoding=encoding_of(Forces))
    wait_for(lambda: rejected(bus), "a refusal")
    before = numbers(bus)["marks"]
    bus.call(keys.service_rpc("probe", "mark"), Empty, Done)
    assert numbers(bus)["marks"] == before + 1
    assert rejected(bus) == {}


# Calls


def test_a_call_repeated_with_its_id_happens_once(bus: Rig, probe: Program) -> None:
    before = numbers(bus)["takes"]
    take = Take(v=VERSION, id="same", who="test", instance="i")
    first, again = (send(bus, keys.goal("torso", "take"), take) for _ in range(2))
    assert first == again
    assert first[0][0]
    assert numbers(bus)["takes"] == before + 1
    other = Take(v=VERSION, id="other", who="test", instance="i")
    answers = send(bus, keys.goal("torso", "take"), other)
    assert [ok for ok, _, _ in answers] == [True], answers
    assert answers != first
    assert numbers(bus)["takes"] == before + 2


def test_one_id_at_two_keys_is_two_calls(bus: Rig, probe: Program) -> None:
    request = Empty(v=VERSION, id="shared", who="test")
    (_, stat, _), (_, config, encoding) = (send(bus, keys.service_rpc("probe", verb), request)[0] for verb in ("stat", "config"))
    assert decode(Stat, stat, encoding_of(Stat))
    assert decode(Config, config, encoding)


def test_an_unknown_part_is_refused_with_those_there_are(bus: Rig, probe: Program) -> None:
    with pytest.raises(CallFailed, match="no part 'tail'; this robot has torso, head, left_arm, right_arm") as caught:
        bus.call("tail/rpc/take", Take, Taken, instance="i")
    assert caught.value.code == "part"


def test_a_wildcard_call_is_answered_or_refused_and_does_no_harm(bus: Rig, probe: Program) -> None:
    everybody = Empty(v=VERSION, id="w1", who="test")
    answers = list(bus.session.get("*/rpc/stat", payload=encode(everybody), encoding=encoding_of(Empty), timeout=2.0))
    assert [str(answer.ok.key_expr) for answer in answers] == ["probe/rpc/stat"]
    refused = send(bus, "*/rpc/take", Take(v=VERSION, id="w2", who="test", instance="i"))
    assert [ok for ok, _, _ in refused] == [False]
    assert probe.is_running


def test_a_bad_request_is_counted_and_answered_with_its_reason(bus: Rig, probe: Program) -> None:
    bus.call(keys.service_rpc("probe", "mark"), Empty, Done)
    key = keys.goal("torso", "take")
    good = encode(Take(v=VERSION, id="x", who="test", instance="i"))
    bad = [
        ("decode", b"\xc1", encoding_of(Take)),
        ("decode", b"", encoding_of(Take)),
        ("type", good, encoding_of(Empty)),
        ("type", good, "zenoh/bytes"),
        ("version", good, encoding_of(Take).replace(f"/{VERSION}", "/99")),
        ("version", encode(Take(v=99, id="x", who="test", instance="i")), encoding_of(Take)),
    ]
    for reason, payload, encoding in bad:
        answers = list(bus.session.get(key, payload=payload, encoding=encoding, timeout=2.0))
        failure = decode(Failure, answers[0].err.payload.to_bytes(), str(answers[0].err.encoding))
        assert failure.code == reason
    assert not list(bus.session.get(key, timeout=2.0))[0].ok  # nor one without a payload
    with pytest.raises(CallFailed, match="no such token"):
        bus.call(key, Take, Taken, instance="nobody")
    assert rejected(bus) == {"decode": 3, "type": 2, "version": 2, "token": 1}


def test_a_call_without_a_server_fails_at_once_with_a_reason(bus: Rig) -> None:
    start = time.monotonic()
    with pytest.raises(CallFailed, match="nobody/rpc/stat: no service answers") as caught:
        bus.call("nobody/rpc/stat", Empty, Stat, timeout=30.0)
    assert caught.value.code == "no_answer"
    assert time.monotonic() - start < 10.0


def test_a_call_without_an_answer_is_repeated_under_the_same_id(bus: Rig) -> None:
    seen: list[str] = []

    def answer(query: zenoh.Query) -> None:
        request = decode(Empty, query.payload.to_bytes(), str(query.encoding))
        seen.append(request.id)
        with query:
            if len(seen) == 3:
                query.reply(query.key_expr, encode(Done(v=VERSION)), encoding=encoding_of(Done))

    server = bus.session.declare_queryable("shy/rpc/do", answer)
    assert rpc.call(bus.session, "test", "shy/rpc/do", Empty, Done, timeout=5.0, tries=3) == Done(v=VERSION)
    assert len(seen) == 3
    assert len(set(seen)) == 1
    server.undeclare()


def test_an_answer_of_the_wrong_type_is_a_failure(bus: Rig) -> None:
    bus.serve("liar/rpc/do", Empty, lambda request, key: Done(v=VERSION))
    with pytest.raises(CallFailed) as caught:
        bus.call("liar/rpc/do", Empty, Stat)
    assert caught.value.code == "bad_answer"


# Streams


def test_what_comes_under_another_key_than_it_was_sent_is_refused(bus: Rig, clock: Any) -> None:
    """As for a moment after a cut of the network, when Zenoh's numbers stand for other keys."""
    before, k = rejected(bus).get("key", 0), bus.bus.k
    misled = Clock(v=VERSION, run="r0", src="r", seq=0, k=k + 1000, t=0, tw=0, dt=10_000_000, mode="free", rate=1.0)
    bus.session.put(Clock.stream.key(), encode(misled), encoding=encoding_of(Clock), attachment="tick")
    wait_for(lambda: rejected(bus).get("key", 0) == before + 1, "the refusal")
    assert numbers(bus)["k"] == k
    call = Empty(v=VERSION, id="misled", who="test")
    [(ok, payload, encoding)] = send(bus, keys.service_rpc("probe", "shutdown"), call, attachment=keys.service_rpc("probe", "stat"))
    assert not ok and decode(Failure, payload, encoding).code == "key"
    assert numbers(bus)["k"] == k  # it still runs


def test_messages_of_another_run_are_refused_and_counted(bus: Rig, clock: Any) -> None:
    bus.call(keys.service_rpc("probe", "mark"), Empty, Done)
    stranger = Bus(bus.session, "stranger", bus.bus.log)
    stranger.run = "another"
    before = numbers(bus)["objects"]
    ball(stranger.publisher(WorldObject, "ball"))
    wait_for(lambda: rejected(bus).get("run") == 1, "the refusal")
    ball(bus.bus.publisher(WorldObject, "ball"))
    wait_for(lambda: numbers(bus)["objects"] == before + 1, "the object of this run")
    assert rejected(bus) == {"run": 1}


def test_a_new_run_is_announced_once_and_its_messages_are_heard(bus: Rig, clock: Any) -> None:
    before = numbers(bus)
    events = bus.record(Event, "probe")
    bus.bus.run, bus.bus.k = "r1", 0
    clock()
    clock()
    assert numbers(bus)["runs"] == before["runs"] + 1
    ball(bus.bus.publisher(WorldObject, "ball"))
    wait_for(lambda: numbers(bus)["objects"] == before["objects"] + 1, "the object of the new run")
    assert "r1" in wait_for(lambda: [e.text for e in events if e.code == "new_run"], "the event")[0]


def test_a_service_that_was_busy_has_not_lost_its_router(bus: Rig, monkeypatch: pytest.MonkeyPatch) -> None:
    """It computes for longer than a service may be without a router, and only then handles the router's token."""
    monkeypatch.setattr(service_module, "ORPHANED", 0.2)
    monkeypatch.setattr(service_module, "BUSY", 0.1)
    with Service("busy", ServiceConfig(endpoint=bus.endpoint), bus.robot) as service:
        time.sleep(0.5)
        service.check_router()
        service.spin(time.monotonic() + 0.05)
        service.check_router()


def test_past_messages_that_come_before_the_first_tick_are_heard_after_it(bus: Rig) -> None:
    decision = bus.bus.publisher(Decision, "left_arm")
    fields = {"agent": "left_arm", "n": 3, "s": 1, "a": 2, "goal": 4, "tries": 0, "reached": 0.5, "expected": 4, "probability": 0.5}
    decision.put(**fields, reward=0.1, explorer="curious", plan=[4])
    seen: list[Decision] = []
    with Service("late", ServiceConfig(endpoint=bus.endpoint), bus.robot) as service:
        service.on_each(Decision, seen.append, history=True)
        heard: list[int] = []
        service.on_clock(lambda clock: heard.append(clock.k))
        service.spin(time.monotonic() + 0.5)
        assert not seen and not heard and service.bus.run == NO_RUN
        bus.bus.publisher(Clock).put(dt=10_000_000, mode="free", rate=1.0)
        service.spin(time.monotonic() + 10.0, lambda: bool(seen))
    assert [one.n for one in seen] == [3] and heard


def test_a_refusal_is_reported_on_the_bus_at_most_once_per_second(bus: Rig, clock: Any) -> None:
    events = bus.record(Event, "probe")
    bus.call(keys.service_rpc("probe", "mark"), Empty, Done)
    start = time.monotonic()
    for n in range(50):
        bus.session.put(WorldObject.stream.key("ball"), b"nonsense", encoding=encoding_of(Clock))
        wait_for(lambda n=n: rejected(bus).get("type", 0) == n + 1, "the refusal")

    def reports() -> list[Event]:
        bus.session.put(WorldObject.stream.key("ball"), b"nonsense", encoding=encoding_of(Clock))
        return [e for e in events if e.code == "refused" and "world/ball" in e.text]

    assert 1 <= len(wait_for(reports, "an event")) <= 2 + time.monotonic() - start


def test_random_bytes_on_every_key_do_no_harm(bus: Rig, clock: Any, rng: np.random.Generator) -> None:
    streams = [
        Clock.stream.key(),
        Forces.stream.key("model"),
        WorldObject.stream.key("ball"),
        keys.service_rpc("probe", "stat"),
        keys.goal("torso", "take"),
    ]
    encodings = [encoding_of(Clock), encoding_of(Forces), encoding_of(WorldObject), "", encoding_of(Take)]
    before = numbers(bus)["k"]
    for _ in range(400):
        key, encoding = streams[rng.integers(5)], encodings[rng.integers(5)]
        bus.session.put(key, rng.bytes(int(rng.integers(0, 300))), encoding=encoding)
    assert numbers(bus)["k"] == before
    clock()


# Ends


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


def test_a_second_token_of_a_router_alone_ends_nothing(tmp_path: Path, bus: Rig) -> None:
    with rig(tmp_path, bus.robot) as parent:
        program, events = another(parent), parent.record(Event, "probe")
        parent.serve(keys.service_rpc("launcher", "stat"), Empty, lambda request, key: stat_of("launcher", "rig"))
        parent.token("router", "stray")
        wait_for(lambda: any(event.code == "two_routers" for event in events), "the event")
        time.sleep(0.5)
        assert program.is_running


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
