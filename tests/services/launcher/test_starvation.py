# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import psutil
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


def measured(*pids: int) -> float:
    """Seconds without a processor, as a share of the time."""
    begin = time.monotonic()
    starvation = Starvation(pids, begin)
    while time.monotonic() < begin + SECONDS:
        time.sleep(PERIOD / 4)
        starvation.update(now := time.monotonic())
    return starvation.total / (now - begin)


def until(condition: Callable[[], bool]) -> None:
    give_up = time.monotonic() + 30.0
    while not condition() and time.monotonic() < give_up:
        time.sleep(0.01)


@contextmanager
def busy_processor() -> Iterator[None]:
    """Three other programs that want the processor."""
    others = [subprocess.Popen([sys.executable, "-c", SPIN]) for _ in range(3)]
    for other in others:
        os.sched_setaffinity(other.pid, {min(os.sched_getaffinity(0))})
    try:
        for other in others:
            until(lambda other=other: psutil.Process(other.pid).cpu_times().user > 0.1)  # it has started, and wants the processor
        yield
    finally:
        for other in others:
            other.kill()
            other.wait()


def test_a_process_that_others_keep_from_the_processor_is_starved(spinning: subprocess.Popen[bytes]) -> None:
    with busy_processor():
        assert measured(spinning.pid) > 0.5
        assert measured(spinning.pid, spinning.pid) <= 1.0  # what waits at the same time


def test_waits_of_processes_one_after_the_other_add_up() -> None:
    """Two processes send a byte to and fro, so that one of the two is waiting at every time."""
    (one, other), (back, forth) = os.pipe(), os.pipe()
    send = "import os\nwhile True: os.read({0}, 1); os.write({1}, b'x')"
    pair = [subprocess.Popen([sys.executable, "-c", send.format(*ends)], pass_fds=ends) for ends in ((one, forth), (back, other))]
    for process in pair:
        os.sched_setaffinity(process.pid, {min(os.sched_getaffinity(0))})
    try:
        os.write(other, b"x")
        with busy_processor():
            both, first = measured(*(process.pid for process in pair)), measured(pair[0].pid)
    finally:
        for process in pair:
            process.kill()
            process.wait()
        for end in (one, other, back, forth):
            os.close(end)
    print(f"share of the time without a processor: both {both:.2f}, the first {first:.2f}")
    assert both > 1.5 * first


def test_a_stopped_process_is_not_starved(spinning: subprocess.Popen[bytes]) -> None:
    spinning.send_signal(signal.SIGSTOP)
    until(lambda: psutil.Process(spinning.pid).status() == psutil.STATUS_STOPPED)  # when it gets a processor
    assert measured(spinning.pid) == pytest.approx(0.0, abs=0.1)


def test_nothing_is_measured_of_a_process_that_has_ended() -> None:
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    starvation = Starvation((ended.pid,), 0.0)
    starvation.update(1.0)
    assert starvation.total == 0.0
