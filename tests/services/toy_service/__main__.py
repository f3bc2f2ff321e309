# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

from services.common.config import load_config
from services.common.service import Service
from tests.services.toy_service.config import Config


def main() -> None:
    config = load_config(Config, None, "toy")
    if config.behaviour == "bad_settings":
        print("toy: file.toml:3: unknown field 'colour'", file=sys.stderr)
        raise SystemExit(2)
    if config.behaviour == "crash_at_start":
        raise RuntimeError("no hardware at all")
    marks = []
    with Service(config.name, config) as service:
        service.describe = lambda: description(service, config, marks)
        service.mark = lambda: marks.append(1)
        if config.behaviour == "talk":
            say(service)
        if config.behaviour == "deaf":
            signal.signal(signal.SIGTERM, signal.SIG_IGN)
        if config.behaviour == "crash_once_ready":
            service.inbox.at(time.monotonic() + config.delay, crash)
        if config.behaviour == "finish":
            service.inbox.at(time.monotonic() + config.delay, service.end)
        service.ready()
        try:
            service.run()
        finally:
            print(f"over at {time.monotonic()}")


def description(service: Service, config: Config, marks: list[int]) -> tuple[str, dict[str, float]]:
    """Describe the service; a toy that freezes does so some time after the first call, since it is not ready before."""
    if config.behaviour == "freeze":
        service.inbox.at(time.monotonic() + config.delay, lambda: os.kill(os.getpid(), signal.SIGSTOP))
    if not marks and config.behaviour in SLOW:
        marks.append(0)
        service.inbox.at(time.monotonic() + config.delay, lambda: SLOW[config.behaviour](service))
    return f"a toy, {config.behaviour}", {"marks": len(marks), "transitions": 7, "action_time_mean": -1.0}


def hang(service: Service) -> None:
    time.sleep(60.0)


def backlog(service: Service) -> None:
    """Four seconds of work arrive at once, in small pieces."""
    for _ in range(800):
        service.inbox.put(lambda: time.sleep(0.005))


def starve(service: Service) -> None:
    """Other programs take the processor for five seconds; the toy gets the rest."""
    cpu = min(os.sched_getaffinity(0))
    spin = f"import os, time; os.sched_setaffinity(0, {{{cpu}}}); end = time.monotonic() + 5\nwhile time.monotonic() < end: pass"
    for _ in range(6):  # before this process yields to them: Popen waits for a child that has the priority of its parent
        subprocess.Popen([sys.executable, "-c", spin])
    for thread in map(int, os.listdir("/proc/self/task")):
        os.sched_setaffinity(thread, {cpu})
        os.sched_setscheduler(thread, os.SCHED_IDLE, os.sched_param(0))


SLOW = {"hang": hang, "backlog": backlog, "starve": starve}


def say(service: Service) -> None:
    service.bus.event("info", "hello", "ten times a second", here=1.0)
    service.inbox.at(time.monotonic() + 0.1, lambda: say(service))


def crash() -> None:
    raise RuntimeError("the motor burnt")


main()
