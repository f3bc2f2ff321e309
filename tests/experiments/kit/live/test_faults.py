# SPDX-License-Identifier: Apache-2.0
"""Schedules of faults, and the checks of the states and transitions of a disturbed system."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import psutil
import pytest

from experiments.kit.live.faults import KINDS, Fault, _frozen, _throttled, _without_disk, draw, shrunk
from experiments.kit.live.floods import flood
from experiments.kit.live.launch import LaunchFailed
from experiments.kit.live.system import Moment, Observer, compare_transitions, stop_after, survived, violations
from mobee.robot.load import load_robot
from mobee.store import STORE, Transition, TransitionStore

SERVICES = ("robot_sim", "controller", "model", "agent_torso", "agent_left_arm")
ROBOT = load_robot("icub")


def test_a_seed_is_a_schedule_and_every_kind_is_drawn() -> None:
    assert draw(7, SERVICES, 10.0, 4.0) == draw(7, SERVICES, 10.0, 4.0)
    drawn = [fault for seed in range(200) for fault in draw(seed, SERVICES, 10.0, 4.0)]
    assert {fault.kind for fault in drawn} == set(KINDS)
    assert {fault.target for fault in drawn if fault.kind == "kill"} == set(SERVICES)
    assert all(0.0 <= fault.at <= 10.0 for fault in drawn)
    assert 1.5 < len(drawn) / 200 < 3.5


@pytest.mark.parametrize("seed", range(20))
def test_a_schedule_is_shrunk_to_the_faults_that_fail_together(seed: int) -> None:
    rng = np.random.default_rng(seed)
    schedule = [Fault(float(at), "kill", f"s{at}") for at in range(10)]
    needed = {schedule[i] for i in rng.choice(10, size=rng.integers(1, 4), replace=False)}
    performed = []

    def fails(shorter: Sequence[Fault]) -> bool:
        performed.append(shorter)
        return needed <= set(shorter)

    assert set(shrunk(schedule, fails, tries=1000)) == needed
    performed.clear()
    shrunk(schedule, fails, tries=3)
    assert len(performed) == 3


def moment(k: int, gate: str = "armed", speed: float = 0.0, q: float = 0.0, run: str = "r") -> Moment:
    mode = "velocity" if gate == "armed" else "hold"
    return Moment(run, k, 0.01 * k, 100.0 + 0.01 * k, gate, mode, 1, np.array([q, 0.0, 0.0]), speed)


def test_a_stop_has_a_time_to_hold_a_time_to_rest_and_a_distance() -> None:
    states = [moment(k, speed=0.3, q=0.003 * k) for k in range(10)]
    states += [moment(k, "hold", speed=0.2, q=0.03 + 0.002 * (k - 9)) for k in range(10, 14)]
    states += [moment(k, "hold", q=0.04) for k in range(14, 20)]
    stop = stop_after(states, 100.055, 101.0)
    assert stop is not None and stop.hold is not None and stop.rest is not None and stop.distance is not None
    assert (stop.hold, stop.rest, stop.distance) == pytest.approx((0.045, 0.085, 0.04 - 0.015))
    assert stop_after([moment(k) for k in range(20)], 100.055, 101.0) is None  # at rest before
    never = stop_after([moment(k, speed=0.3) for k in range(20)], 100.055, 101.0)
    assert never is not None and never.hold is None


@pytest.mark.parametrize(
    ("after", "expected"),
    [
        ([], True),
        ([(2.0, "suspended", "a"), (3.0, "moving", "a"), (4.0, "settled", "a"), (5.0, "moving", "b")], True),
        ([(2.0, "suspended", "a"), (2.2, "held", "a")], False),
        ([(2.0, "idle", "")], False),
        ([(2.0, "moving", "b")], False),
        ([(11.0, "held", "a")], True),  # later
    ],
)
def test_an_action_survives_a_fault_if_it_has_an_outcome_or_continues(after: list[tuple[float, str, str]], expected: bool) -> None:
    assert survived([(0.5, "settled", "z"), (0.9, "moving", "a"), *after], 1.0, 10.0) is expected
    assert survived([(0.5, "settled", "z"), *after], 1.0, 10.0) is None


def test_a_jump_and_a_tick_that_goes_back_are_violations_and_a_new_run_is_none() -> None:
    fine = [moment(0), moment(1, q=0.005), moment(5, run="s", q=-1.0), moment(6, run="s", q=-1.0)]
    assert violations({"torso": fine}, ROBOT, 0.001) == []
    assert "deg too far" in violations({"torso": [moment(0), moment(1, q=0.1)]}, ROBOT, 0.001)[0]
    assert violations({"torso": [moment(3), moment(2)]}, ROBOT, 0.001) == ["torso: tick 2 after tick 3"]


def test_a_transition_that_is_lost_or_differs_is_found(tmp_path: Path) -> None:
    with TransitionStore(tmp_path / STORE, "torso") as store:
        for n in (1, 2):
            store.append(Transition(n, 1, 2, 3, 0.5, True, 4.0, (0.0,)))
    observer = Observer()
    observer.published = {("torso", n): (1, 2, 3, True, 4.0) for n in (1, 2)}
    kept = compare_transitions(observer, tmp_path, ["torso"])
    assert (kept.kept, kept.lost, kept.differing, kept.repeated) == (2, 0, 0, 0)
    observer.published |= {("torso", 3): (1, 2, 3, True, 4.0), ("torso", 2): (1, 2, 4, True, 4.0)}
    kept = compare_transitions(observer, tmp_path, ["torso"])
    assert (kept.lost, kept.differing) == (1, 1)


WRITER = """
import sys, time
n = 0
while True:
    try:
        with open(sys.argv[1], "wb", buffering=0) as file:
            file.write(b"x")
        print("written", flush=True)
    except OSError as error:
        print(error.strerror, flush=True)
    time.sleep(0.01)
"""


def is_stopped(pid: int) -> bool:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "T"


def test_disk_and_freeze_faults_act_and_end(tmp_path: Path) -> None:
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(tmp_path / "file")], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        assert process.stdout.readline() == "written\n"
        with _without_disk(process.pid):
            said = [process.stdout.readline() for _ in range(10)]
            assert said[-1] == "File too large\n"
        assert "written\n" in [process.stdout.readline() for _ in range(10)]
        for lasting in (_frozen, _throttled):
            with lasting(process.pid):
                give_up = time.monotonic() + 10.0
                while not is_stopped(process.pid):
                    assert time.monotonic() < give_up
            assert process.poll() is None
            assert not is_stopped(process.pid)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
        process.stdout.close()


def test_a_flood_that_ends_before_its_time_is_an_error() -> None:
    with pytest.raises(LaunchFailed, match="'idle connections' ended with code 1"), flood("no endpoint", "idle connections"):
        (started,) = (each for each in psutil.Process().children() if "experiments.kit.live.floods" in each.cmdline())
        give_up = time.monotonic() + 30.0
        while started.status() != psutil.STATUS_ZOMBIE:
            assert time.monotonic() < give_up
            time.sleep(0.01)
