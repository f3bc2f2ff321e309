# SPDX-License-Identifier: Apache-2.0
"""Launches a live system of real processes, with or without a performer, and exchanges files with it.

A performer is a service that calls a function of an experiment.  It reads what to do from a file (the job), and appends its results to
another.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from msgspec import Struct

from experiments.kit.run_folder import decoded, encoded
from mobee.errors import MobeeError

_START_TIMEOUT, _END_TIMEOUT = 120.0, 30.0  # s
_WATCH_PERIOD = 0.5  # s between two calls of `watch`
TABLE = Path(__file__).with_name("table.xml")  # a world: the iCub's table with nothing on it


class LaunchFailed(MobeeError):
    """Raised if a live system fails or does not end; the message has the last line of its error output."""


def summary_of(
    scenario: str,
    settings: Sequence[str] = (),
    *,
    duration: float | None = None,
    ticks: int | None = None,
    environment: Mapping[str, str] | None = None,
    runs: Path | None = None,
    watch: Callable[[int], None] = lambda pid: None,
) -> dict[str, Any]:
    """Launch a scenario without monitor, wait for its end, and return the launcher's summary of the run as a dict.  Raises LaunchFailed.

    Args:
        scenario: name or path.
        settings: changes of the scenario, as "FIELD=VALUE".
        duration: time after which the system ends, s; None: no limit.
        ticks: in lockstep, number of ticks after which it ends; None: no limit.
        environment: additional environment variables.
        runs: folder in which the run folder is made; None: a temporary one.
        watch: function that is called with the launcher's process id twice a second.
    """
    with tempfile.TemporaryDirectory() as scratch:
        argv = [*launch_command(scenario, free_endpoint(), runs or Path(scratch), settings), "--no-record"]
        argv += [] if duration is None else ["--duration", str(duration)]
        argv += [] if ticks is None else ["--ticks", str(ticks)]
        # In a process group of its own, so that a terminal's Ctrl-C reaches only this process, which then stops it in order.
        process = subprocess.Popen(
            argv, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, process_group=0, env={**os.environ, **(environment or {})}
        )
        try:
            output, errors = _watched(process, watch, math.inf if ticks else _START_TIMEOUT + _END_TIMEOUT + (duration or 0.0))
        except subprocess.TimeoutExpired:
            raise LaunchFailed(f"{scenario}: it did not end in time") from None
        finally:
            stop(process)
    if process.returncode != 0:
        raise LaunchFailed(f"{scenario}: ended with code {process.returncode}: {(errors.strip().splitlines() or ['no message'])[-1]}")
    return dict(json.loads(output))


def launch_command(scenario: str, endpoint: str, runs: Path, settings: Sequence[str]) -> list[str]:
    """Return the command that launches a scenario without monitor.

    `endpoint`: address of the system's router.  `runs`: folder in which the folder of the run is made.  `settings`: changes of the
    scenario, as "FIELD=VALUE".
    """
    argv = [sys.executable, "-m", "mobee_system", "launch", scenario, "--headless", "--json", "--endpoint", endpoint, "--runs", str(runs)]
    return [*argv, *(f"--set={setting}" for setting in settings)]


def _watched(process: subprocess.Popen[str], watch: Callable[[int], None], seconds: float) -> tuple[str, str]:
    """Wait at most `seconds` s for the end of a process, and return the texts of its standard output and its standard error.

    Until then `watch` is called with the process id twice a second.  Raises TimeoutExpired if the process does not end in time.
    """
    deadline = time.monotonic() + seconds
    while True:
        try:
            output, errors = process.communicate(timeout=_WATCH_PERIOD)
        except subprocess.TimeoutExpired:
            if time.monotonic() > deadline:
                raise
            watch(process.pid)
        else:
            return output, errors


def stop(process: subprocess.Popen[Any]) -> int:
    """Stop a system whose launcher leads its own process group: by SIGINT, or by SIGKILL if it has not ended after 30 s.

    `process`: the launcher.  Returns its exit code.
    """
    if process.poll() is None:
        process.send_signal(signal.SIGINT)
        try:
            process.communicate(timeout=_END_TIMEOUT)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()
    return int(process.returncode)


def free_port() -> int:
    """Return a TCP port of the loopback interface that is free now."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def free_endpoint() -> str:
    """Return the address of a TCP port of the loopback interface that is free now, as "tcp/127.0.0.1:PORT"."""
    return f"tcp/127.0.0.1:{free_port()}"


T = TypeVar("T", bound=Struct)
JOB, DONE = "job.json", "done.jsonl"


def write_job(folder: Path, job: Struct) -> None:
    """Make the folder and write the job, a msgspec Struct, to job.json; results of an interrupted launch are removed.

    A job has what the function of a performer (a service that calls a function of an experiment) needs to know.
    """
    folder.mkdir(parents=True, exist_ok=True)
    (folder / DONE).unlink(missing_ok=True)
    (folder / JOB).write_text(encoded(job))


def read_job(folder: Path, kind: type[T]) -> T:
    """Return the job that `write_job` wrote into the folder, as an object of the type `kind`.

    A job states what a function of an experiment is to do on the live robot.
    """
    return decoded((folder / JOB).read_text(), kind)


def append_done(folder: Path, record: Struct) -> None:
    """Append a result of a job, a msgspec Struct, to done.jsonl in the folder; it is in the file when this function returns."""
    with (folder / DONE).open("a") as file:
        file.write(encoded(record) + "\n")


def read_done(folder: Path, kind: type[T]) -> list[T]:
    """Return all results of type `kind` that `append_done` wrote into the folder; [] if there are none."""
    path = folder / DONE
    return [decoded(line, kind) for line in path.read_text().splitlines()] if path.exists() else []


PHYSICS = ("pybullet", "mujoco")  # back-ends of robot_sim; the published numbers are of the first


def add_backend(parser: argparse.ArgumentParser) -> None:
    """Add the option --backend, the physics engine of robot_sim, to the parser."""
    parser.add_argument("--backend", choices=PHYSICS, default=PHYSICS[0], help=f"the physics (default: {PHYSICS[0]})")


TICK_TIMEOUT = 60.0  # s for a tick of lockstep; the performer plans within one tick

_SCENARIO = """# Written by an experiment.
title = "{title}"

[shared]
robot = "icub"
gains = "default"
seed = {seed}
{mode}

[services.robot_sim]
rate = {rate:g}
record = "{folder}"
{simulator}

[services.model]
world = "{world}"

[services.controller]
speed_scale = {speed:g}

[services.performer]
module = "experiments.kit.live.performer"
perform = "{perform}"
run_dir = "{folder}"
"""


def launch(
    folder: Path,
    perform: str,
    *,
    title: str,
    world: str,
    seed: int,
    rate: float,
    speed: float,
    seconds: float,
    lockstep: bool = True,
    simulator: Mapping[str, Any] = {},
) -> dict[str, Any]:
    """Launch the live iCub with physics and a performer, wait for its end, and return the launcher's summary.  Raises LaunchFailed.

    The performer is a service that calls a function of an experiment.

    Args:
        folder: where scenario, recording and run folder are written.
        perform: the performer's function, as "package.module:function"; it is called with the service and this folder.
        title: of the scenario.
        world: name or path of the model's world.
        seed: of the robot.
        rate: control rate, Hz.
        speed: share of the motors' largest speed.
        seconds: robot time after which the system ends at the latest.
        lockstep: whether the ticks wait for all services; False: real time.
        simulator: further settings of robot_sim by name; a value is text, a number or a dict of such values.  The default
            of "backend" is "pybullet", that of "world" is `world`.
    """
    folder.mkdir(parents=True, exist_ok=True)
    mode = f'mode = "lock"\npatience = {TICK_TIMEOUT:g}' if lockstep else ""
    scenario = folder / "scenario.toml"
    settings = "\n".join(f"{name} = {_toml(value)}" for name, value in ({"backend": PHYSICS[0], "world": world} | dict(simulator)).items())
    values: dict[str, Any] = {"title": title, "world": world, "simulator": settings, "seed": seed, "mode": mode}
    values |= {"rate": rate, "speed": speed, "perform": perform}
    scenario.write_text(_SCENARIO.format(folder=folder.resolve(), **values))
    limit: dict[str, Any] = {"ticks": round(seconds * rate)} if lockstep else {"duration": seconds}
    return summary_of(str(scenario), runs=folder / "launch", **limit)


def _toml(value: Any) -> str:
    """Write text, a number, or a dict of these as TOML."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{name} = {_toml(one)}" for name, one in value.items()) + " }"
    return json.dumps(value)
