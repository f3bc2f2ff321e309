# SPDX-License-Identifier: Apache-2.0
"""A client on the live bus: reads the state of the left arm while the system runs.

Without options it starts a system of its own for a few seconds; with `--endpoint tcp/127.0.0.1:7447` it connects to the system
that `./launch` started.
"""

from __future__ import annotations

import argparse
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

import mobee
import mobee_system  # noqa: F401  (puts the packages of the live system on the path)
from bus_schema.messages import State
from services.common.config import ServiceConfig
from services.common.service import Service
from services.common.session import BusUnreachable

SAMPLES, EVERY, PATIENCE = 5, 1.0, 30.0  # times, s, s

robot = mobee.load_robot("icub")
elbow = robot.parts["left_arm"].motors.index("l_elbow")


@contextmanager
def own_system() -> Iterator[str]:
    """Start `mobee launch kinematic` on a free port for the block of a `with` statement; yield its endpoint, "tcp/127.0.0.1:PORT".

    The system ends at the end of the block, or by itself after a minute.
    """
    with socket.socket() as probe, tempfile.TemporaryDirectory() as runs:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
        probe.close()
        launch = [sys.executable, "-m", "mobee_system", "launch", "kinematic", "--headless", "--duration", "60"]
        process = subprocess.Popen([*launch, "--endpoint", endpoint, "--runs", runs], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            yield endpoint
        finally:
            process.terminate()
            process.wait()


def watch(endpoint: str) -> None:
    """Connect, wait until the agent moves the left arm, and print its state."""
    with Service(f"client_{os.getpid()}", ServiceConfig(endpoint=endpoint), robot) as service:
        states: deque[State] = deque(maxlen=1000)

        service.on_newest(State, states.append, "left_arm")
        service.on_clock(lambda clock: None)  # gives the run: messages of another run are refused
        service.spin(time.monotonic() + PATIENCE, lambda: bool(service.alive.get("agent_left_arm")))
        states.clear()
        service.spin(time.monotonic() + PATIENCE, lambda: len(states) > 0 and np.ptp([states[0].q, states[-1].q], axis=0).max() > 0.1)
        if not states:
            raise SystemExit(f"nothing from the left arm within {PATIENCE:g} s: is a robot running at {endpoint}?")
        for _ in range(SAMPLES):
            service.spin(time.monotonic() + EVERY)
            state = states[-1]
            angle, speed = np.rad2deg(state.q[elbow]), np.rad2deg(np.abs(state.dq).max())
            print(f"tick {state.k}: left arm {state.gate}, elbow at {angle:5.1f} deg, fastest motor {speed:4.1f} deg/s")
        print(f"on the bus: {', '.join(sorted(who for who, instances in service.alive.items() if instances))}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--endpoint", help="router of a running system; left out: one is started")
    given = parser.parse_args().endpoint
    if given:
        try:
            watch(given)
        except BusUnreachable as error:
            raise SystemExit(str(error)) from None
    else:
        with own_system() as endpoint:
            watch(endpoint)
