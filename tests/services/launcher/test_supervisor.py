# SPDX-License-Identifier: Apache-2.0
"""Which processes the supervisor counts as frozen, and with which priority they start."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, cast

import pytest

from services.common.service import Service
from services.launcher.catalogue import entry_of
from services.launcher.child import Child, Program
from services.launcher.supervisor import FROZEN_TIME, FROZEN_TIME_NICE, STANDBY_DELAY, STANDBY_PERIOD, Supervisor

ROOT = Path(__file__).parents[3]


class Silent:
    """Stands in for the bus: nothing is published, nobody is heard."""

    instance = "i1_launcher"

    def on_alive(self, handler: object) -> None: ...


def test_waiting_for_a_processor_or_an_inbox_that_advances_is_no_silence() -> None:
    child = Child(Program("model", (), Path("model.log")), phase="ready")
    child.note_answer(100.0)
    child.note_silence(100.5)
    assert child.starvation is not None
    child.starvation.total = 1.5
    assert child.silence(102.0) == pytest.approx(0.5)
    child.note_pulse(7, 101.0)
    assert child.silence(102.0) == pytest.approx(0.5)
    child.note_pulse(7, 102.0)
    assert child.silence(103.0) == pytest.approx(1.5)
    child.note_pulse(8, 103.0)  # a new measurement begins
    assert child.silence(103.5) == pytest.approx(0.5)
    child.note_answer(104.0)
    assert (child.silence(105.0), child.handled) == (pytest.approx(1.0), None)


@pytest.mark.parametrize(("nice", "limit"), [(0, FROZEN_TIME), (10, FROZEN_TIME_NICE)])
def test_what_yields_to_others_may_be_silent_for_longer(nice: int, limit: float) -> None:
    supervisor = Supervisor(cast("Service", Silent()), [], cast("Any", None), lambda text: None)
    child = Child(Program("monitor", (), Path("monitor.log"), nice=nice), phase="ready", unanswered=5, answered_at=time.monotonic())
    assert not supervisor._is_frozen(child, child.answered_at + limit - 0.1)
    assert supervisor._is_frozen(child, child.answered_at + limit)


def test_a_service_that_is_ready_for_long_has_a_standby_process(tmp_path: Path) -> None:
    supervisor = Supervisor(cast("Service", Silent()), [], cast("Any", None), lambda text: None)
    children = [
        Child(Program(who, ("sleep", "60"), tmp_path / f"{who}.log", standby=standby), phase="ready", since=100.0)
        for who, standby in (("model", True), ("monitor", False), ("controller", True))
    ]
    prepared = []
    try:
        for now in (100.0 + STANDBY_DELAY - 0.1, 100.0 + STANDBY_DELAY, 100.0 + STANDBY_DELAY + STANDBY_PERIOD):
            for child in children:
                supervisor._check_standby(child, now)
            prepared.append([child.who for child in children if child.standby is not None])
        assert prepared == [[], ["model"], ["model", "controller"]]
    finally:
        for child in children:
            child.dismiss()


def test_a_vital_service_has_a_standby_process_unless_its_program_is_a_users() -> None:
    entries = {(who, module): entry_of(who, module) for who, module in (("robot_sim", None), ("vision", None), ("robot_sim", "my_arm"))}
    assert {key: entry is not None and entry.has_standby for key, entry in entries.items()} == {
        ("robot_sim", None): True,
        ("vision", None): False,
        ("robot_sim", "my_arm"): False,
    }


def test_the_standby_process_takes_the_place_of_one_that_failed(tmp_path: Path) -> None:
    child = Child(Program("model", ("sleep", "60"), tmp_path / "model.log"))
    try:
        child.spawn("launcher")
        child.prepare("launcher")
        assert child.standby is not None
        standby = child.standby.pid
        child.kill()
        child.spawn("launcher")
        assert (child.pid, child.standby) == (standby, None)
        child.prepare("launcher")
        child.standby.kill()
        child.standby.wait()
        dead = child.standby.pid
        child.kill()
        child.spawn("launcher")
        assert child.running()
        assert child.pid != dead
    finally:
        child.kill()
        child.dismiss()


SPAWN = """import os
from pathlib import Path
from services.launcher.child import Child, Program
child = Child(Program("monitor", ("sleep", "60"), Path("monitor.log"), nice=10))
child.spawn("launcher")
print(os.getpriority(os.PRIO_PROCESS, child.pid))
child.process.kill()
"""


@pytest.mark.parametrize("nice", [0, 15])
def test_no_process_has_a_higher_priority_than_the_launcher(tmp_path: Path, nice: int) -> None:
    """Only root may start one."""
    own = min(19, os.getpriority(os.PRIO_PROCESS, 0) + nice)
    argv = ["nice", "-n", str(nice), sys.executable, "-c", SPAWN]
    done = subprocess.run(argv, cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True)
    assert int(done.stdout) == max(own, 10)
