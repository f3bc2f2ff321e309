# SPDX-License-Identifier: Apache-2.0
"""After an emergency stop nothing moves before its reset, even if processes end, freeze or start, or commands are sent."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from experiments.kit.live.faults import FORGED_PART, FaultInjector, draw_around_stop
from services.common.session import open_client
from tests.system.live import AGENTS, PARTS, Launch, Watcher, launch, until

pytestmark = pytest.mark.system

SCHEDULES = int(os.environ.get("MOBEE_SCHEDULES", "1"))  # 500 for the whole campaign
FIRST = int(os.environ.get("MOBEE_FIRST_SCHEDULE", "1"))
BRAKING = 0.5  # s after the stop in which a part may still move
RESTS = np.deg2rad(1.5)  # largest difference of two measured poses at rest: noise and backlash


def is_ready(system: Launch) -> bool:
    return "all ready" in system.errors.read_text() or system.process.poll() is not None


def start(folder: Path, endpoint: str | None = None) -> Launch:
    folder.mkdir(exist_ok=True)
    system = launch(folder, "kinematic", endpoint=endpoint)
    until(lambda: is_ready(system), 120.0, "the system is ready")
    assert system.process.poll() is None, system.errors.read_text()[-3000:]
    return system


def mobee(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "mobee_cli", *arguments], capture_output=True, text=True, timeout=60.0)


def all_stopped(endpoint: str) -> bool:
    status = mobee("status", "--json", "--endpoint", endpoint)
    parts = json.loads(status.stdout)["parts"] if status.stdout.startswith("{") else {}
    return set(parts) == set(PARTS) and all(part["gate"] == "estop" for part in parts.values())


def epoch_of(watcher: Watcher) -> int | None:
    """The newest drive epoch of the part that forged calls name."""
    states = watcher.states[FORGED_PART]
    return states[-1].epoch if states else None


def motion_after(watcher: Watcher, since: float) -> tuple[int, float]:
    """Number of states of an armed part, and the largest move [rad] within one run, from a monotonic time on."""
    armed, moved = 0, 0.0
    for part in PARTS:
        late = [state for state in watcher.states[part] if state.tw * 1e-9 > since]
        armed += sum(state.gate == "armed" for state in late)
        for run in {state.run for state in late}:
            poses = np.array([state.q for state in late if state.run == run])
            moved = max(moved, float(np.ptp(poses, axis=0).max()))
    return armed, moved


def campaign(folder: Path, seeds: range) -> None:
    """Perform the schedules one after the other; after each the robot is released and must move again."""
    system = start(folder / "first")
    watchers = [Watcher(system.endpoint).__enter__()]
    try:
        for seed in seeds:
            watchers[-1].wait_until_moved(AGENTS, faster=0.02)
            schedule = draw_around_stop(seed)
            print(f"{seed}: {'; '.join(map(str, schedule))}", flush=True)
            with open_client(system.endpoint) as session:
                times = FaultInjector(session, system.endpoint, system.process.pid, partial(epoch_of, watchers[-1])).perform(schedule)
            stopped = next(at for at, fault in zip(times, schedule, strict=True) if fault.kind == "stop")
            if any((fault.kind, fault.target) == ("kill", "launcher") for fault in schedule):
                system.process.wait(20.0)
                system = start(folder / f"after-{seed}", system.endpoint)
                watchers.append(Watcher(system.endpoint).__enter__())
            until(partial(all_stopped, system.endpoint), 60.0, "every part reports the stop")
            time.sleep(1.0)
            armed, moved = map(max, zip(*(motion_after(each, stopped + BRAKING) for each in watchers), strict=True))
            print(f"{seed}: {armed} armed states, moved {np.rad2deg(moved):.2f} deg", flush=True)
            assert armed == 0
            assert moved < RESTS
            released = mobee("estop", "--reset", "--endpoint", system.endpoint)
            assert released.returncode == 0, released.stderr
            if "given up after" in system.errors.read_text():  # the schedules killed one service six times in a minute
                system.process.send_signal(signal.SIGINT)
                system.process.communicate(timeout=30.0)
                system = start(folder / f"anew-{seed}", system.endpoint)
                watchers.append(Watcher(system.endpoint).__enter__())
            while len(watchers) > 1:
                watchers.pop(0).__exit__()
    finally:
        for watcher in watchers:
            watcher.__exit__()
        if system.process.poll() is None:
            system.process.send_signal(signal.SIGINT)
        system.process.communicate(timeout=30.0)


def test_nothing_moves_between_a_stop_and_its_reset(tmp_path: Path) -> None:
    campaign(tmp_path, range(FIRST, FIRST + SCHEDULES))
