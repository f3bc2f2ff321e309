# SPDX-License-Identifier: Apache-2.0
"""A bus with the test as its router: it plays the services that are not under test."""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

import numpy as np
import zenoh

from bus_schema import keys
from bus_schema.messages import Clock, Message, ObjectTruth, State, Truth
from bus_schema.rpc import Empty, Stat
from mobee.arrays import Array
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.common import rpc
from services.common.bus import Bus, Latest, Publisher
from services.common.session import open_router

TICK = 10_000_000  # ns
THREADS = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")


class Stage:
    """Router, clock and motor states; a service under test runs as a real process beside it."""

    def __init__(self, port: int, run: str = "r1") -> None:
        self.endpoint = f"tcp/127.0.0.1:{port}"
        self.robot: Robot = load_robot("icub")
        self.session: zenoh.Session = open_router(self.endpoint)
        self.bus = Bus(self.session, "stage", logging.getLogger("stage"))
        self.bus.run = run
        self.bus.robot_size = len(self.robot.motors)
        self.bus.part_sizes = {name: len(part) for name, part in self.robot.parts.items()}
        self.k = 0
        self._token = self.session.liveliness().declare_token(keys.alive("router", "stage"))
        self._clock = self.bus.publisher(Clock)
        self._states = {part: self.bus.publisher(State, part) for part in self.robot.parts}
        self._truth = self.bus.publisher(Truth)

    def publisher(self, cls: type[Message], name: str = "") -> Publisher[Any]:
        return self.bus.publisher(cls, name, delivery="LATEST")

    def latest(self, cls: type[Message], name: str = "*") -> Latest[Any]:
        return self.bus.latest(cls, name)

    def tick(self, q: Array) -> None:
        """One tick as robot_sim has it: the clock, then every part's state."""
        self.bus.k, self.bus.t = self.k, self.k * TICK
        self._clock.put(dt=TICK, mode="free", rate=1.0)
        for name, part in self.robot.parts.items():
            zeros = [0.0] * len(part)
            state = {"mode": "velocity", "gate": "armed", "faults": 0, "epoch": 1, "cmd_seq": self.k, "cmd_age": 1}
            self._states[name].put(q=q[part.slice].tolist(), dq=zeros, tau=zeros, **state)
        self.k += 1

    def put_ball(self, position: Array) -> None:
        """Where robot_sim has the ball."""
        ball = ObjectTruth(name="ball", position=position.tolist(), quaternion=[1.0, 0.0, 0.0, 0.0])
        self._truth.put(q=self.robot.home.tolist(), depth=0.0, pair="", gap=-1.0, objects=[ball])

    def play(self, q: Callable[[float], Array] | Array, until: Callable[[], bool], limit: float = 30.0) -> bool:
        """Ticks at 100 Hz until something has happened; False if it did not within `limit` s."""
        begin = deadline = time.monotonic()
        while not until():
            now = time.monotonic()
            if now - begin > limit:
                return False
            self.tick(q(now - begin) if callable(q) else q)
            deadline += TICK * 1e-9
            time.sleep(max(0.0, deadline - time.monotonic()))
        return True

    def stat(self, who: str) -> Stat:
        return rpc.call(self.session, "stage", keys.service_rpc(who, "stat"), Empty, Stat, timeout=10.0)

    def is_up(self, who: str) -> bool:
        return any(True for _ in self.session.liveliness().get(f"alive/{who}/*"))

    @contextmanager
    def running(self, module: str, who: str, *flags: str, limit: float = 60.0) -> Iterator[subprocess.Popen[str]]:
        """The service as a process, from its readiness on; ended at the end."""
        command = [sys.executable, "-m", module, "--endpoint", self.endpoint, *flags]
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env={**os.environ, **THREADS})
        try:
            give_up = time.monotonic() + limit
            while not self.is_up(who):
                assert process.poll() is None and time.monotonic() < give_up, process.communicate(timeout=1.0)[1]
                time.sleep(0.05)
            yield process
        finally:
            process.terminate()
            process.communicate(timeout=20.0)

    def close(self) -> None:
        self.session.close()


def matched(stage: Stage, key: str, cls: type[Message], seconds: float = 0.3) -> bool:
    """Whether anybody subscribes to a key, as the bus itself says."""
    publisher = Publisher(stage.bus, key, cls, "LATEST")
    give_up = time.monotonic() + seconds
    while not publisher.has_subscribers and time.monotonic() < give_up:
        time.sleep(0.02)
    return publisher.has_subscribers


def posture(robot: Robot, degrees: Mapping[str, float]) -> Array:
    """Home, with some motors elsewhere."""
    q = robot.home.copy()
    for name, value in degrees.items():
        q[robot.motor_index(name)] = np.deg2rad(value)
    return q


LOOKING_DOWN = {"torso_pitch": 10.0, "neck_pitch": -26.0, "eyes_tilt": -18.0, "eyes_vergence": 11.0}
