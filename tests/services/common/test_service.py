# SPDX-License-Identifier: Apache-2.0
"""The life of a service, as a real process on a real bus: its answers and its refusals; its end is in test_service_end.py."""

from __future__ import annotations

import json
import logging
import time
from collections.abc import Iterator
from typing import Any, Literal

import numpy as np
import pytest
import zenoh

from bus_schema import VERSION, decode, encode, encoding_of, keys
from bus_schema.messages import Clock, Decision, Event, Forces, WorldObject
from bus_schema.rpc import Config, Done, Empty, Failure, Stat, Take, Taken
from services.common import rpc
from services.common.bus import NO_RUN, Bus
from services.common.config import ServiceConfig
from services.common.rpc import CallFailed
from services.common.service import Service
from tests.services.common.probe_config import PROBE, ball
from tests.services.harness import Program, Rig, wait_for


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


def numbers(bus: Rig) -> dict[str, float]:
    return bus.stat("probe").numbers


def rejected(bus: Rig) -> dict[str, int]:
    return bus.stat("probe").rejected


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


@pytest.mark.parametrize(("mode", "runs"), [("free", True), ("lock", False), ("paused", False)])
def test_the_bus_clock_runs_on_between_two_ticks_except_in_lockstep_and_pauses(
    bus: Rig, mode: Literal["free", "lock", "paused"], runs: bool
) -> None:
    known = Bus(bus.bus.session, "clock", logging.getLogger("clock"))
    known.note_time(Clock(v=VERSION, run="r1", src="robot_sim", seq=0, k=5, t=50, tw=0, dt=10, mode=mode, rate=2.0))
    time.sleep(0.005)
    assert known.t == 50 and (known.now() >= 50 + 10_000_000 if runs else known.now() == 50)
