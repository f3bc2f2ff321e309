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
from services.launcher.child import Child, Program
from services.launcher.supervisor import FROZEN_TIME, FROZEN_TIME_NICE, Supervisor

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
