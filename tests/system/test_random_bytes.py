"""Random bytes on every key of a running system: counted, and nothing dies."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest

from bus_schema import encoding_of, keys
from bus_schema.messages import Clock, Command, Forces, State
from tests.system.live import AGENTS, PARTS, Watcher, running, transitions, until

pytestmark = pytest.mark.system

SERVICES = ("robot_sim", "model", "controller", "agent_torso", "agent_left_arm", "agent_right_arm")
ENCODINGS = ("", *(encoding_of(cls) for cls in (Clock, Command, Forces, State)))


def stream_keys() -> list[str]:
    streams = [make(part) for part in PARTS for make in (keys.state, keys.command, keys.motion)]
    single = [keys.CLOCK, keys.ESTOP, keys.MODEL_FORCES, keys.MODEL_POSE, keys.MODEL_CONTACTS, keys.SIM_TRUTH]
    return [*streams, *single, keys.world("ball"), keys.world("nothing"), keys.transition("torso"), keys.event("robot_sim")]


def call_keys() -> list[str]:
    drives = [keys.drive("torso", verb) for verb in ("take", "arm", "release", "hold")]
    goals = [keys.goal("torso", verb) for verb in ("take", "release", "goal", "force")]
    sims = [keys.sim(verb) for verb in ("place", "reset", "pause", "resume")]
    world = [keys.world_rpc(verb) for verb in ("add", "move", "remove", "role", "attach", "detach", "list")]
    every = [keys.service_rpc(who, verb) for who in SERVICES for verb in ("stat", "mark", "config", "shutdown")]
    return [*drives, *goals, *sims, *world, *every, keys.MODEL_JACOBIAN, keys.ESTOP_RESET, keys.meta("torso")]


def test_random_bytes_on_every_key_are_refused_and_nothing_dies(tmp_path: Path) -> None:
    rng = np.random.default_rng(11)
    with running(tmp_path, "kinematic") as (system, watcher):
        pids = {who: watcher.stat(who).pid for who in SERVICES}
        run = watcher.run
        watcher.close_streams()
        for _ in range(40):
            for key in stream_keys():
                watcher.session.put(key, rng.bytes(int(rng.integers(0, 400))), encoding=str(rng.choice(ENCODINGS)))
            time.sleep(0.02)
        for key in call_keys():
            answers = watcher.session.get(key, payload=rng.bytes(60), encoding=str(rng.choice(ENCODINGS)), timeout=2.0)
            assert all(answer.ok is None for answer in answers), key
        assert {who: watcher.stat(who).pid for who in SERVICES} == pids
        assert sum(watcher.stat("robot_sim").rejected.values()) >= 40
        assert sum(watcher.stat("controller").rejected.values()) >= 40
        with Watcher(system.endpoint) as again:
            counts = {agent: len(transitions(system.run_dir)[agent]) for agent in AGENTS}
            until(lambda: all(len(transitions(system.run_dir)[a]) > counts[a] for a in AGENTS), 60.0, "every agent goes on")
            assert until(lambda: again.run, 20.0, "the second watcher hears the clock") == run
