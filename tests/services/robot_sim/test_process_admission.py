# SPDX-License-Identifier: Apache-2.0
"""Whose commands the process obeys, and for how long."""

from __future__ import annotations

import time
from typing import Any

import numpy as np
import pytest

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.messages import Command, EStop, Message
from bus_schema.rpc import Empty, Place, Request, Take, WithEpoch
from services.common.rpc import CallFailed
from tests.services.harness import wait_for
from tests.services.robot_sim.bench import ARM, DT, ELBOW, ROBOT, Bench, elbow


def test_an_armed_arm_follows_velocities_and_says_which_command_is_in_force(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    before = bench.newest("left_arm").q[ELBOW]
    state = bench.keep("left_arm", epoch, 0.5, lambda: elbow(0.3))
    assert state.gate == "armed"
    assert state.epoch == epoch
    assert state.mode == "velocity"
    assert state.cmd_seq >= 0
    assert state.dq[ELBOW] == pytest.approx(0.3, abs=0.02)
    assert 0.08 < state.q[ELBOW] - before < 0.2
    assert bench.newest("right_arm").gate == "idle"


def test_without_new_commands_it_holds_after_the_ttl_within_the_time_that_braking_takes(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    since = bench.now()
    bench.keep("left_arm", epoch, 0.3, lambda: elbow(-0.6))
    bench.send("left_arm", epoch, elbow(-0.6), ttl=100)
    hold = bench.hears("hold", since, "ttl 100 ms")
    stopped = bench.hears("stopped", hold.k)
    assert bench.next_state("left_arm").gate == "hold"
    took, angle = stopped.values["time"] * 1e3, np.degrees(stopped.values["distance"])
    print(f"\nstopped {took:.0f} ms after the last tick under command, {angle:.2f} deg")
    braking = 0.6 / np.radians(600)
    ticks = int(np.ceil(braking / DT)) + 1
    assert stopped.k - hold.k <= ticks
    assert stopped.values["distance"] < 0.6 * DT + 0.6 * braking
    at_rest = bench.next_state("left_arm").q[ELBOW]
    time.sleep(0.2)
    assert bench.next_state("left_arm").q[ELBOW] == pytest.approx(at_rest, abs=0.02)


def test_a_second_token_of_the_model_that_comes_and_goes_holds_nothing_and_the_first_one_does(bench: Bench) -> None:
    bench.rig.token("model", "first")
    epoch = bench.arm("left_arm")
    since = bench.now()
    bench.rig.token("model", "ghost")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.1))
    bench.rig.drop_token("model", "ghost")
    bench.keep("left_arm", epoch, 0.3, lambda: elbow(0.1))
    assert not [event for event in bench.events_since(since) if event.code == "hold"]
    bench.rig.drop_token("model", "first")
    bench.hears("hold", since, "model is gone")


def test_a_command_that_comes_after_the_hold_is_refused_until_the_part_is_armed_again(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    since = bench.now()
    bench.send("left_arm", epoch, elbow(0.1), ttl=20)
    bench.hears("hold", since, "ttl 20 ms")
    bench.refuses("not_armed", lambda: bench.send("left_arm", epoch, elbow(0.1)))
    assert bench.next_state("left_arm").gate == "hold"
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    bench.keep("left_arm", epoch, 0.1, lambda: elbow(0.1))
    assert bench.next_state("left_arm").gate == "armed"


@pytest.mark.parametrize("who", ["controller", "model", "router"])
def test_the_arm_holds_at_once_when_a_token_is_gone(bench: Bench, who: str) -> None:
    instance = "rig" if who == "router" else "victim"
    if who != "router":
        bench.rig.token(who, instance)
    bench.free("left_arm")
    epoch = bench.take("left_arm", instance if who == "controller" else "c1")
    wait_for(lambda: _armed(bench, "left_arm", epoch), "arming")
    bench.keep("left_arm", epoch, 0.2, lambda: elbow(0.5))
    since = bench.now()
    bench.rig.drop_token(who, instance)
    bench.hears("stopped", since)
    if who == "router":
        bench.rig.token(who, instance)  # in time: without any, the service ends
    events = bench.events_since(since, "left_arm")
    assert [event.code for event in events[:2]] == ["hold", "stopped"]
    assert who in events[0].text
    assert bench.next_state("left_arm").gate == "hold"


def _armed(bench: Bench, part: str, epoch: int) -> bool:
    try:
        return bench.drive(part, "arm", epoch) == "armed"
    except CallFailed as error:
        assert error.code == "no_token"
        return False


def test_a_client_without_a_token_cannot_arm(bench: Bench) -> None:
    bench.free("left_arm")
    epoch = bench.take("left_arm", "nobody")
    with pytest.raises(CallFailed, match="declare it") as caught:
        bench.drive("left_arm", "arm", epoch)
    assert caught.value.code == "no_token"


def test_a_part_whose_owner_runs_cannot_be_taken(bench: Bench) -> None:
    bench.free("left_arm")
    epoch = bench.arm("left_arm")
    bench.rig.token("controller", "stranger")
    with pytest.raises(CallFailed, match="must release") as caught:
        bench.take("left_arm", "stranger")
    assert caught.value.code == "owned"
    assert bench.drive("left_arm", "arm", epoch) == "armed"
    bench.rig.drop_token("controller", "stranger")


def test_of_two_owners_the_older_can_do_nothing_any_more(bench: Bench) -> None:
    old = bench.arm("left_arm")
    new = bench.arm("left_arm")
    with pytest.raises(CallFailed) as caught:
        bench.drive("left_arm", "hold", old)
    assert caught.value.code == "epoch"
    before, refused = bench.next_state("left_arm").q[ELBOW], bench.rejected("epoch")
    bench.keep("left_arm", old, 0.2, lambda: elbow(0.5))
    assert bench.rejected("epoch") > refused
    assert bench.next_state("left_arm").q[ELBOW] == pytest.approx(before, abs=0.02)
    bench.keep("left_arm", new, 0.3, lambda: elbow(0.5))
    assert bench.next_state("left_arm").q[ELBOW] > before + 0.05
    assert bench.drive("left_arm", "release", new) == "idle"


def test_wrong_commands_are_refused_counted_by_reason_and_move_nothing(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    bus, k = bench.rig.bus, bench.clocks[-1].k
    wrong: list[tuple[str, dict[str, Any]]] = [
        ("epoch", {"epoch": epoch - 1, "ref": elbow(0.5)}),
        ("length", {"ref": [0.5] * 3}),
        ("value", {"ref": elbow(float("nan"))}),
        ("value", {"ref": elbow(float("inf"))}),
        ("velocity", {"ref": elbow(2.0)}),
        ("position", {"ref": [9.0] * ARM, "mode": "position"}),
        ("step", {"ref": bench.newest("left_arm").q[:ELBOW] + [0.5] + bench.newest("left_arm").q[ELBOW + 1 :], "mode": "position"}),
        ("torque", {"ref": elbow(400.0), "mode": "torque"}),
        ("future", {"ref": elbow(0.5), "re_k": k + 10**6}),
        ("age", {"ref": elbow(0.5), "re_k": max(0, k - 50)}),
    ]
    before = bench.next_state("left_arm").q
    for reason, fields in wrong:
        bench.refuses(reason, lambda fields=fields: bench.send(**{"part": "left_arm", "epoch": epoch, **fields}))
    run, bus.run = bus.run, "another_run"
    bench.refuses("run", lambda: bench.send("left_arm", epoch, elbow(0.5)))
    bus.run = run
    assert bench.next_state("left_arm").q == pytest.approx(before, abs=0.02)
    bench.hears("refused", 0, "epoch")


def test_a_replayed_command_is_refused(bench: Bench) -> None:
    epoch = bench.arm("left_arm")
    k = bench.clocks[-1].k
    header = {"v": VERSION, "run": bench.rig.bus.run, "src": "x", "seq": 10**6, "k": k, "t": 0, "tw": 0}
    payload = encode(Command(**header, epoch=epoch, re_k=k, mode="velocity", ref=elbow(0.0), ttl=100))
    before = bench.rejected("seq")
    bench.rig.session.put(Command.stream.key("left_arm"), payload, encoding=encoding_of(Command))
    assert bench.rejected("seq") == before
    bench.refuses("seq", lambda: bench.rig.session.put(Command.stream.key("left_arm"), payload, encoding=encoding_of(Command)))


def test_random_bytes_on_every_key_move_nothing_and_kill_nothing(bench: Bench, rng: np.random.Generator) -> None:
    epoch = bench.arm("left_arm")
    streams: list[tuple[str, type[Message]]] = [(Command.stream.key(part), Command) for part in ROBOT.parts] + [(EStop.stream.key(), EStop)]
    calls: list[tuple[str, type[Request]]] = [(keys.drive(part, "take"), Take) for part in ("left_arm", "*", "nobody")]
    calls += [(keys.drive("left_arm", verb), WithEpoch) for verb in ("arm", "release", "hold")] + [(keys.sim("place"), Place)]
    calls += [(keys.sim(verb), Empty) for verb in ("reset", "pause", "resume")]
    calls += [(keys.service_rpc("robot_sim", verb), Empty) for verb in ("stat", "mark", "config", "shutdown")]
    calls += [(keys.ESTOP_RESET, Empty), (keys.meta("torso"), Empty)]
    run, before = bench.clocks[-1].run, {part: bench.next_state(part).q for part in ROBOT.parts}
    header = {"v": VERSION, "run": run, "src": "x", "seq": 5, "k": 1, "t": 1, "tw": 1}
    good = encode(Command(**header, epoch=epoch, re_k=10**9, mode="velocity", ref=elbow(1.0), ttl=100))
    refused = sum(bench.rig.stat("robot_sim").rejected.values())
    for number in range(2000):
        noise = rng.bytes(int(rng.integers(0, 200)))
        if number % 2:
            broken = bytearray(good)
            for at in rng.integers(0, len(good), 3):
                broken[at] = int(rng.integers(0, 256))
            noise = bytes(broken)
        is_call = number % 4 == 0
        key, cls = calls[number // 4 % len(calls)] if is_call else streams[number % len(streams)]
        encoding = encoding_of(cls) if number % 3 else str(rng.choice(["", "text/plain", "application/msgpack;icub/Command/99"]))
        if is_call:
            assert all(answer.ok is None for answer in bench.rig.session.get(key, payload=noise, encoding=encoding, timeout=0.5))
        else:
            bench.rig.session.put(key, noise, encoding=encoding)
        if number % 20 == 0:
            time.sleep(0.001)  # only the newest of a burst is read
    stat = bench.rig.stat("robot_sim")
    assert bench.program.is_running
    assert bench.clocks[-1].run == run
    assert sum(stat.rejected.values()) > refused + 100
    for part, q in before.items():
        assert bench.next_state(part).q == pytest.approx(q, abs=0.03)
        assert bench.newest(part).gate != "estop"
    bench.keep("left_arm", bench.arm("left_arm"), 0.2, lambda: elbow(0.1))
    assert bench.next_state("left_arm").gate == "armed"
