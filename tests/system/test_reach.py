# SPDX-License-Identifier: Apache-2.0
"""Reaching with all services: bit-equal to offline; the state after the reaching client is killed; playback of a roadmap."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bus_schema import decode, keys
from bus_schema.messages import Playback, Reach
from bus_schema.rpc import Empty, World
from experiments.kit.live.launch import summary_of
from mobee import Gains, Model, OfflinePlant, load_robot, load_world
from mobee.reach import TARGET
from mobee.roadmap.roadmap import Roadmap
from services.common import rpc
from tests.services.harness import ROOT
from tests.system.live import Launch, Watcher, running, until
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
    world.remove("ball")  # live, it is not seen without cameras
    plant = OfflinePlant(Model(robot, world), seed=SEED, gains=Gains.default(), dt=TICK)
    offline = list(perform(plant))
    assert live == offline
    print("mm missing:", [round(1e3 * outcome["missing"]) for outcome in offline if "missing" in outcome])


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Launch, Watcher]]:
    with running(tmp_path_factory.mktemp("reach"), str(SCENARIO)) as pair:
        yield pair


def test_the_command_reaches_a_place_in_the_running_system(live: tuple[Launch, Watcher]) -> None:
    system, watcher = live
    reached = command("reach", "--target", "-0.3", "0.2", "0.1", "--endpoint", system.endpoint)
    assert reached["reached"] and reached["settled"]
    until(lambda: watcher.motions[PART][-1].epoch == 0, 2.0, "the goal to be released")


def test_a_roadmap_is_played_on_the_running_robot(live: tuple[Launch, Watcher], tmp_path: Path) -> None:
    """Also just after a reach, when the torso turns back, which the reach's force had turned."""
    system, watcher = live
    command("reach", "--target", "-0.3", "0.2", "0.1", "--endpoint", system.endpoint)
    seen: list[Playback] = []
    subscriber = watcher.session.declare_subscriber(
        Playback.stream.key(), lambda sample: seen.append(decode(Playback, sample.payload.to_bytes(), str(sample.encoding)))
    )
    played = command("roadmap", "play", str(two_poses(tmp_path / "map.npz")), "--to", "1", "--live", "--endpoint", system.endpoint)
    print(f"remaining error {1e3 * played['remaining_error']:.1f} mm")
    assert played["remaining_error"] < 0.005  # m; up to 0.0104 from a torso that still turns when the path is planned
    assert played["arrived"] and played["solid"] == 0.0 and played["seconds"] > 1.0
    seen = [one for one in seen if one.src == seen[-1].src]  # of the last attempt
    assert {one.phase for one in seen[:-1]} == {"moving"} and len(seen) > 3
    assert seen[-1].phase == "over" and 1e3 * abs(seen[-1].missing - played["remaining_error"]) < 1.0
    subscriber.undeclare()
    until(lambda: watcher.motions[PART][-1].epoch == 0, 2.0, "the goal to be released")


def test_when_the_program_that_reaches_is_killed_the_arm_brakes_and_the_target_is_removed(live: tuple[Launch, Watcher]) -> None:
    system, watcher = live
    reaches: list[Reach] = []
    subscriber = watcher.session.declare_subscriber(
        Reach.stream.key(PART), lambda sample: reaches.append(decode(Reach, sample.payload.to_bytes(), str(sample.encoding)))
    )
    argv = [sys.executable, "-m", "tests.system.reacher", "--endpoint", system.endpoint, "--in-vain"]
    reacher = subprocess.Popen(argv, cwd=ROOT, env=dict(os.environ))
    try:
        until(lambda: reaches and watcher.speed(PART) > 0.1, 30.0, "the reach")
        assert TARGET in objects(watcher)
        reacher.kill()
        until(lambda: reaches[-1].phase == "interrupted", 2.0, "the end of the reach")
    finally:
        reacher.kill()
        reacher.wait()
    k = reaches[-1].k
    until(lambda: watcher.motions[PART][-1].status == "idle", 2.0, "the part without an action")
    assert watcher.motions[PART][-1].epoch == 0
    until(lambda: watcher.k > k + 100, 5.0, "a second to pass")
    there = np.array(watcher.states[PART][-1].q)
    until(lambda: watcher.k > k + 200, 5.0, "another one")
    assert np.abs(watcher.states[PART][-1].q - there).max() < STILL
    assert TARGET not in objects(watcher)
    assert reaches[-1].phase == "interrupted"
    subscriber.undeclare()


def two_poses(path: Path) -> Path:
    """Write a roadmap of two poses of the right arm in free space, and one edge."""
    robot, world = load_robot("icub"), load_world("table")
    world.remove("ball")
    q = np.repeat(robot.home[None], 2, axis=0)
    moves = ["r_shoulder_pitch", "r_shoulder_roll", "r_elbow"]
    q[:, [robot.motor_index(name) for name in moves]] = [(-0.5, 0.8, 0.9), (-0.6, 0.9, 1.1)]
    Roadmap(Model(robot, world), q, np.array([[0.0], [1.0]]), np.array([[0, 1]]), np.ones(1), {"motors": moves}).save(path)
    return path


def command(*words: str) -> dict[str, Any]:
    """Run a command of `mobee` that moves the running robot; returns what it prints as JSON."""
    argv = [sys.executable, "-m", "mobee_cli", *words, "--json"]
    for _ in range(ATTEMPTS):
        done = subprocess.run(argv, cwd=ROOT, capture_output=True, text=True, timeout=100)
        if "interrupted" not in done.stderr:
            break
    assert done.returncode == 0, done.stderr + done.stdout
    return dict(json.loads(done.stdout))


def objects(watcher: Watcher) -> set[str]:
    """The objects of the model's world."""
    return {thing.name for thing in rpc.call(watcher.session, "test", keys.world_rpc("list"), Empty, World, timeout=2.0).objects}
