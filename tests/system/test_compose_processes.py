# SPDX-License-Identifier: Apache-2.0
"""The commands of docker/compose.yaml as plain processes: the same system without its launcher."""

from __future__ import annotations

import os
import signal
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from experiments.kit.live.launch import free_endpoint, free_port
from tests.docker.compose_commands import as_processes
from tests.system.live import AGENTS, Watcher, transitions, until

pytestmark = pytest.mark.system

# s from SIGTERM until a process has ended.  Of 40 monitors with page and recording, on two cores with a load of 27, the slowest took 1.1 s;
# a machine whose cores other programs share can stall for longer than that.
END_TIMEOUT = 30.0


@contextmanager
def composed(folder: Path, port: int) -> Iterator[dict[str, subprocess.Popen[bytes]]]:
    processes = {}
    environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    try:
        for name, argv in as_processes(port).items():
            if name == "monitor":  # another system may be up on this machine
                argv += ["--web-port", str(free_port())]
            log = (folder / f"{name}.log").open("wb")
            processes[name] = subprocess.Popen(argv, cwd=folder, stdout=log, stderr=log, env=environment, start_new_session=True)
        yield processes
    finally:
        for process in reversed(processes.values()):
            process.send_signal(signal.SIGTERM)
        for name, process in processes.items():
            assert process.wait(END_TIMEOUT) == 0, (name, (folder / f"{name}.log").read_text()[-1500:])


def test_the_composed_system_learns(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    with composed(tmp_path, int(endpoint.rsplit(":", 1)[1])) as processes:
        until(lambda: (tmp_path / "transitions.sqlite").exists(), 60.0, "the agents have begun")
        with Watcher(endpoint) as watcher:
            watcher.wait_until_moved(AGENTS)
            watcher.pid("vision")  # the agents do not wait for it
            until(lambda: watcher.stat("vision").numbers["located"] > 0, 30.0, "the ball is located")
        until(lambda: any(transitions(tmp_path).values()), 60.0, "a transition is on disk")
        until(lambda: "ready as" in (tmp_path / "monitor.log").read_text(), 60.0, "the monitor can end in order")
        assert all(process.poll() is None for process in processes.values())
