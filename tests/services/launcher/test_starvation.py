# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator

import pytest

from services.launcher.starvation import PERIOD, Starvation

pytestmark = pytest.mark.skipif(not hasattr(os, "SCHED_IDLE"), reason="only Linux reports how long a thread waits for a processor")
SECONDS = 1.5
SPIN = "while True: pass"


@pytest.fixture
def spinning() -> Iterator[subprocess.Popen[bytes]]:
    """A process that always wants the processor, and gets one only if no other program does."""
    process = subprocess.Popen([sys.executable, "-c", SPIN], preexec_fn=lambda: os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0)))
    os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
    yield process
    process.kill()
    process.wait()


def measured(pid: int) -> float:
    begin = time.monotonic()
    starvation = Starvation((pid,), begin)
    while time.monotonic() < begin + SECONDS:
        time.sleep(PERIOD / 4)
        starvation.update(time.monotonic())
    return starvation.total


def test_a_process_that_others_keep_from_the_processor_is_starved(spinning: subprocess.Popen[bytes]) -> None:
    others = [subprocess.Popen([sys.executable, "-c", SPIN]) for _ in range(3)]
    for other in others:
        os.sched_setaffinity(other.pid, {min(os.sched_getaffinity(0))})
    try:
        time.sleep(0.3)
        assert measured(spinning.pid) > SECONDS / 2
    finally:
        for other in others:
            other.kill()
            other.wait()


def test_a_stopped_process_is_not_starved(spinning: subprocess.Popen[bytes]) -> None:
    spinning.send_signal(signal.SIGSTOP)
    time.sleep(0.1)
    assert measured(spinning.pid) == pytest.approx(0.0, abs=0.1)


def test_nothing_is_measured_of_a_process_that_has_ended() -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    starvation = Starvation((ended.pid,), 0.0)
    starvation.update(1.0)
    assert starvation.total == 0.0
