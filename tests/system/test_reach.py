# SPDX-License-Identifier: Apache-2.0
"""Reaching with all services: as offline, to the bit; what is left when who reaches is killed; and a map that is played."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import decode, keys
from bus_schema.messages import Reach
from bus_schema.rpc import Empty, World
from experiments.kit.live.launch import summary_of
from mobee import Gains, Model, OfflinePlant, load_robot, load_world
from mobee.reach import TARGET
from mobee.roadmap.roadmap import Roadmap
from services.common import rpc
from tests.services.harness import ROOT
from tests.system.live import Watcher, running, until
from tests.system.reacher.script import PART, perform

pytestmark = pytest.mark.system

SCENARIO = Path(__file__).with_name("reaching.toml")
SEED, TICK = 3, 0.02
TICKS = 1200  # the script is over before
ATTEMPTS = 3  # a busy machine may let the robot hold in mid-motion, which the verb reports
STILL = 0.02  # rad in a second, eight times the noise of encoders; their differences are as noisy at rest as a slow motion is fast


@pytest.mark.untimed
def test_live_reaches_in_lockstep_are_those_of_the_offline_plant_to_the_bit(tmp_path: Path) -> None:
    scenario = tmp_path / "reaching.toml"
    scenario.write_text(f'{SCENARIO.read_text()}\n[services.reacher]\nmodule = "tests.system.reacher"\n')
    settings = ["shared.mode=lock", "shared.patience=20", "services.robot_sim.rate=50"]
    summary = summary_of(str(scenario), settings, ticks=TICKS, runs=tmp_path / "runs")
    assert summary["lockstep"]["repeatable"]
    live = json.loads((Path(summary["run"]) / "reaches.json").read_text())
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")  # live, nobody sees it without cameras
    plant = OfflinePlant(Model(robot, world), seed=SEED, gains=Gains.default(), dt=TICK)
    offline = list(perform(plant))
    assert live == offline
    print("mm missing:", [round(1e3 * outcome["missing"]) for outcome in offline if "missing" in outcome])


def test_a_map_is_played_and_when_who_reaches_is_killed_the_arm_brakes_and_the_target_is_gone(tmp_path: Path) -> None:
    with running(tmp_path, str(SCENARIO)) as (system, watcher):
        played = play_a_map(tmp_path / "map.npz", system.endpoint)
        assert played["arrived"] and played["solid"] == 0.0 and played["seconds"] > 1.0
        until(lambda: watcher.motions[PART][-1].epoch == 0, 2.0, "the goal to be given back")
        told: list[Reach] = []
        kept = watcher.session.declare_subscriber(
            Reach.stream.key(PART), lambda sample: told.append(decode(Reach, sample.payload.to_bytes(), str(sample.encoding)))
        )
        argv = [sys.executable, "-m", "tests.system.reacher", "--endpoint", system.endpoint, "--in-vain"]
        reacher = subprocess.Popen(argv, cwd=ROOT, env=dict(os.environ))
        try:
            until(lambda: told and watcher.speed(PART) > 0.1, 30.0, "the reach")
            assert TARGET in objects(watcher)
            reacher.kill()
            until(lambda: told[-1].phase == "interrupted", 2.0, "the end of the reach")
        finally:
            reacher.kill()
            reacher.wait()
        k = told[-1].k
        until(lambda: watcher.motions[PART][-1].status == "idle", 2.0, "the part without an action")
        assert watcher.motions[PART][-1].epoch == 0
        until(lambda: watcher.k > k + 100, 5.0, "a second to pass")
        there = np.array(watcher.states[PART][-1].q)
        until(lambda: watcher.k > k + 200, 5.0, "another one")
        assert np.abs(watcher.states[PART][-1].q - there).max() < STILL
        assert TARGET not in objects(watcher)
        assert told[-1].phase == "interrupted"
        kept.undeclare()


def play_a_map(path: Path, endpoint: str) -> dict[str, Any]:
    """Two poses of the right arm in the open, and the way to the second, as `mobee roadmap play --live --json` tells of it."""
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")
    q = np.repeat(robot.home[None], 2, axis=0)
    moves = ["r_shoulder_pitch", "r_shoulder_roll", "r_elbow"]
    q[:, [robot.motor_index(name) for name in moves]] = [(-0.5, 0.8, 0.9), (-0.6, 0.9, 1.1)]
    Roadmap(Model(robot, world), q, np.array([[0.0], [1.0]]), np.array([[0, 1]]), np.ones(1), {"motors": moves}).save(path)
    argv = [sys.executable, "-m", "mobee_cli", "roadmap", "play", str(path), "--to", "1", "--live", "--endpoint", endpoint, "--json"]
    for _ in range(ATTEMPTS):
        done = subprocess.run(argv, cwd=ROOT, capture_output=True, text=True, timeout=100)
        if "the motion was interrupted" not in done.stderr:
            break
    assert done.returncode == 0, done.stderr
    return dict(json.loads(done.stdout))


def objects(watcher: Watcher) -> set[str]:
    """What is in the model's world."""
    return {thing.name for thing in rpc.call(watcher.session, "test", keys.world_rpc("list"), Empty, World, timeout=2.0).objects}
