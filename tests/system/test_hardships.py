# SPDX-License-Identifier: Apache-2.0
"""What a running system goes through, one after the other: forces that come late, random bytes, the death of its launcher."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bus_schema import encoding_of, keys
from bus_schema.messages import Clock, Command, Contacts, EStop, Event, Forces, Motion, Pose, State, Transition, Truth, WorldObject
from mobee import load_robot
from tests.system.live import AGENTS, PARTS, Launch, Watcher, running, transitions, until

ROBOT = load_robot("icub")
pytestmark = pytest.mark.system

TICK = 0.01  # s
FROZEN = 0.3  # s: longer than forces stay fresh, shorter than the launcher bears
GRACE = 0.2  # s until it holds: three ticks of old forces, or the commands' time to live
BRAKES = 0.3  # s: from 60 deg/s at 600 deg/s^2, and the motors' delay and lag
AT_REST = 0.01  # rad/s

SERVICES = ("robot_sim", "model", "controller", "agent_torso", "agent_left_arm", "agent_right_arm")
ENCODINGS = ("", *(encoding_of(cls) for cls in (Clock, Command, Forces, State)))


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launch, Watcher]]:
    with running(tmp_path_factory.mktemp("hardships"), "kinematic", "services.robot_sim.encoder_noise=0.0") as pair:
        yield pair


def test_late_forces_make_the_robot_slow_down_and_hold_and_never_jump(live: tuple[Launch, Watcher]) -> None:
    _, watcher = live
    until(lambda: any(watcher.speed(part) > 0.15 for part in AGENTS), 40.0, "a part moves")
    pid = watcher.pid("model")
    watcher.wait_until_it_keeps_up()
    k = watcher.k
    os.kill(pid, signal.SIGSTOP)
    try:
        until(lambda: watcher.k >= k + round(FROZEN / TICK), 10.0, "ticks without forces")
    finally:
        os.kill(pid, signal.SIGCONT)
    until(lambda: all(watcher.states[part][-1].mode == "velocity" for part in PARTS), 20.0, "all obey again")
    until(lambda: any(watcher.speed(part) > 0.05 for part in AGENTS), 20.0, "a part moves again")
    last = watcher.k
    for part in PARTS:
        seen = [state for state in watcher.states[part] if k - 5 <= state.k <= last]
        held = next(state.k for state in seen if state.mode == "hold" and state.k > k)
        assert (held - k) * TICK <= GRACE
        rest = next(state.k for state in seen if state.k > held and max(map(abs, state.dq)) < AT_REST)
        assert (rest - held) * TICK <= BRAKES
        motors = [ROBOT.motor_table[ROBOT.motor_index(name)] for name in ROBOT.part(part).motors]
        fastest = np.array([motor.max_velocity for motor in motors])
        hardest = np.array([motor.max_acceleration for motor in motors])
        for before, after in pairwise(seen):
            passed = (after.t - before.t) * 1e-9 + TICK  # both are means over the tick before them
            assert (np.abs(np.subtract(after.q, before.q)) <= fastest * passed).all()
            assert (np.abs(np.subtract(after.dq, before.dq)) <= hardest * passed).all()


def stream_keys() -> list[str]:
    streams = [make(part) for part in PARTS for make in (State.stream.key, Command.stream.key, Motion.stream.key)]
    single = [
        Clock.stream.key(),
        EStop.stream.key(),
        Forces.stream.key("model"),
        Pose.stream.key(),
        Contacts.stream.key(),
        Truth.stream.key(),
    ]
    return [
        *streams,
        *single,
        WorldObject.stream.key("ball"),
        WorldObject.stream.key("nothing"),
        Transition.stream.key("torso"),
        Event.stream.key("robot_sim"),
    ]


def call_keys() -> list[str]:
    drives = [keys.drive("torso", verb) for verb in ("take", "arm", "release", "hold")]
    goals = [keys.goal("torso", verb) for verb in ("take", "release", "goal", "force")]
    sims = [keys.sim(verb) for verb in ("place", "reset", "pause", "resume")]
    world = [keys.world_rpc(verb) for verb in ("add", "move", "remove", "role", "attach", "detach", "list")]
    every = [keys.service_rpc(who, verb) for who in SERVICES for verb in ("stat", "mark", "config", "shutdown")]
    return [*drives, *goals, *sims, *world, *every, keys.MODEL_JACOBIAN, keys.ESTOP_RESET, keys.meta("torso")]


def send_random_bytes(watcher: Watcher) -> None:
    """On every key; all are refused, and no service ends."""
    rng = np.random.default_rng(11)
    pids = {who: watcher.pid(who) for who in SERVICES}
    watcher.close_streams()
    for _ in range(40):
        for key in stream_keys():
            watcher.session.put(key, rng.bytes(int(rng.integers(0, 400))), encoding=str(rng.choice(ENCODINGS)))
        time.sleep(0.02)
    for key in call_keys():
        answers = watcher.session.get(key, payload=rng.bytes(60), encoding=str(rng.choice(ENCODINGS)), timeout=2.0)
        assert all(answer.ok is None for answer in answers), key
    assert {who: watcher.pid(who) for who in SERVICES} == pids
    for who in ("robot_sim", "controller"):
        until(lambda who=who: sum(watcher.stat(who).rejected.values()) >= 40, 10.0, f"the refusals of {who}")


def test_random_bytes_on_every_key_are_refused_and_no_process_ends(live: tuple[Launch, Watcher]) -> None:
    system, watcher = live
    run = watcher.run
    send_random_bytes(watcher)
    with Watcher(system.endpoint) as again:
        assert until(lambda: again.run, 20.0, "the second watcher hears the clock") == run
        until(lambda: all(again.states[part] and again.states[part][-1].gate == "armed" for part in PARTS), 20.0, "every part obeys")
        until(lambda: any(again.speed(part) > 0.1 for part in AGENTS), 40.0, "a part moves")


@pytest.mark.untimed
def test_random_bytes_do_not_disturb_lockstep_and_every_agent_learns_on(tmp_path: Path) -> None:
    with running(tmp_path, "kinematic", "shared.mode=lock", "shared.patience=20") as (system, watcher):
        until(lambda: watcher.k > 0, 60.0, "tick 1")
        send_random_bytes(watcher)
        counts = {agent: len(transitions(system.run_dir)[agent]) for agent in AGENTS}
        until(lambda: all(len(transitions(system.run_dir)[a]) > counts[a] for a in AGENTS), 60.0, "every agent continues")
        assert watcher.stat("robot_sim").numbers["flaws"] == 0.0


def test_without_launcher_and_router_the_robot_holds_and_everything_ends(live: tuple[Launch, Watcher]) -> None:
    system, _ = live
    with Watcher(system.endpoint) as watcher:
        until(lambda: any(watcher.speed(part) > 0.15 for part in AGENTS), 40.0, "a part moves")
        pids = [watcher.pid(who) for who in ("robot_sim", "model", "controller", "agent_torso")]
        before = transitions(system.run_dir)
        os.kill(system.process.pid, signal.SIGKILL)
        until(lambda: all(f"hold: {part}" in system.log("robot_sim") for part in PARTS), 5.0, "every part holds")
        until(lambda: not any(_runs(pid) for pid in pids), 30.0, "no orphan is left")
    after = transitions(system.run_dir)
    assert all(after[agent][: len(before[agent])] == before[agent] for agent in AGENTS)


def _runs(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as status:
            return status.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False
