# SPDX-License-Identifier: Apache-2.0
"""A live system that runs during a `with` statement: it is launched as a user launches it, and ended as by Ctrl-C."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bus_schema import keys
from bus_schema.rpc import Empty, Stat
from experiments.kit.live.launch import LaunchFailed, free_endpoint, launch_command, stop
from services.common import rpc
from services.common.emergency_stop import StopRecord

_START_TIMEOUT = 120.0  # s
_STATES = "state"  # folder of states


@dataclass
class System:
    """A running live system: the processes of the robot software, which exchange messages on a bus.

    `process`: the launcher, which starts and supervises all other processes.  `endpoint`: address of the system's Zenoh router.  `folder`:
    contains the folder of the run, the launcher's error output, and the file with the record of the emergency stops.
    """

    process: subprocess.Popen[str]
    endpoint: str
    folder: Path  # of run folders, errors and the record of emergency stops

    @property
    def run_dir(self) -> Path:
        """The folder of the run, into which the system writes its files, such as the transitions of the agents."""
        return next((self.folder / "runs").iterdir())

    @property
    def stop_record(self) -> StopRecord:
        """The record of the system's emergency stops."""
        return StopRecord.of_endpoint(self.endpoint, self.folder / _STATES)

    @property
    def says(self) -> str:
        """The text that the launcher (the process that starts all others) has written to standard error so far."""
        return (self.folder / "launcher.err").read_text()


@contextmanager
def running(folder: Path, scenario: str) -> Iterator[System]:
    """Launch a live system, yield it when all its services are ready, and stop it at the end of the `with` statement.

    `folder`: an empty folder for its files.  `scenario`: name or path of the file that lists its services and their settings; the monitor
    (the service that shows the robot on a web page) does not run.  Raises LaunchFailed.
    """
    endpoint = free_endpoint()
    environment = {**os.environ, "XDG_STATE_HOME": str(folder / _STATES)}
    with (folder / "launcher.err").open("w") as errors:
        argv = launch_command(scenario, endpoint, folder / "runs", ())
        process = subprocess.Popen(argv, stdout=subprocess.PIPE, stderr=errors, text=True, process_group=0, env=environment)
    system = System(process, endpoint, folder)
    try:
        wait_for(lambda: "all ready" in system.says or process.poll() is not None, _START_TIMEOUT, "the system is ready")
        if process.poll() is not None:
            raise LaunchFailed(f"{scenario}: ended with code {process.returncode}: {(system.says.splitlines() or ['no message'])[-1]}")
        yield system
    finally:
        stop(process)


def wait_for(condition: Callable[[], Any], timeout: float, what: str, period: float = 0.01) -> Any:
    """Call `condition` every `period` s until it returns a true value, and return this value; raises LaunchFailed after `timeout` s.

    `what`: what was expected, as text for the error message.
    """
    give_up = time.monotonic() + timeout
    while not (value := condition()):
        if time.monotonic() > give_up:
            raise LaunchFailed(f"not within {timeout:g} s: {what}")
        time.sleep(period)
    return value


def stat_of(session: Any, who: str, timeout: float = 0.5) -> Stat | None:
    """Return the status of the service `who`; None if it does not answer within `timeout` s.  `session`: a Zenoh session."""
    try:
        return rpc.call(session, "observer", keys.service_rpc(who, "stat"), Empty, Stat, timeout=timeout)
    except rpc.CallFailed:
        return None
