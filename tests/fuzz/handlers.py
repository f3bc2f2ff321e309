# SPDX-License-Identifier: Apache-2.0
"""What a fuzzer feeds to the handlers of a service: messages and calls, on a session without a network in this process.

`python -m tests.fuzz.handlers N` feeds N seeds to each service, without atheris.

An input is a sequence of blocks: a byte that chooses a stream or call, and the payload.  Every input is a run of robot_sim of its own, with
a tick before and after it, so that what a service has learned from one run does not reach the next one.
"""

from __future__ import annotations

import json
import logging
import os
import random
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import msgspec
import zenoh

from bus_schema import VERSION, encode, encoding_of
from bus_schema.messages import Clock, PartStatus, Tick
from bus_schema.page import streams
from bus_schema.rpc import CALLS
from experiments.kit.live.malformed import ENDS, Drawer
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.common.service import Service
from services.controller.config import Config as ControllerConfig
from services.controller.node import ControllerNode
from services.model.config import Config as ModelConfig
from services.model.node import ModelNode
from services.robot_sim.config import Config as SimConfig
from services.robot_sim.make import make_backend
from services.robot_sim.node import Node as SimNode

DIVIDER = b"\n%%\n"  # between the blocks of one input
MOST_BLOCKS = 20
DRAWN, LENGTH = 400, 4  # seeds, and messages in each
STRANGER = "client_7"  # the name of other processes in keys
RUN = "r"  # of the messages among the seeds; the harness writes the present run in its place
WAIT = 30.0  # s for the reply to a call, long because the tests run this process with the lowest priority
TICK = 10_000_000  # ns
ROBOT = cache(load_robot)
_ALONE = {"mode": "peer", "scouting/multicast/enabled": False, "listen/endpoints": [], "timestamping/enabled": {"peer": True}}


@dataclass(frozen=True, slots=True)
class Entry:
    """A stream or call that a service reads: a key, the type, and whether it is a call."""

    key: str
    cls: Any
    call: bool


def entries_of(who: str) -> list[Entry]:
    """Return all streams and calls that a service reads, each for every part; without the call that ends it."""
    parts, found = tuple(ROBOT("icub").parts), list[Entry]()
    for cls in streams():
        if who in cls.stream.readers:
            names = parts if cls.stream.variable == "part" else (STRANGER,)
            found += [Entry(cls.stream.key(name), cls, call=False) for name in names]
    for call in CALLS:
        if who in call.servers:
            for verb in {*(call.verbs or ("",))} - {*ENDS}:
                key = call.pattern.replace("{service}", who).replace("{verb}", verb)
                found += [Entry(key.replace("{part}", part), call.request, call=True) for part in (parts if "{part}" in key else ("",))]
    return sorted(found, key=lambda entry: entry.key)


class System:
    """One service, whose clock and clients the fuzzer plays."""

    def __init__(self, who: str) -> None:
        self.who, self.entries, robot = who, entries_of(who), ROBOT("icub")
        self._session = _session()
        settings, make = SERVICES[who]
        self.service = Service(who, settings, robot, session=self._session, prompt=True)
        self.service._open_session = _session
        self.service.log.setLevel(logging.CRITICAL)
        self.node = make(self.service, settings, robot)
        self._runs, self._k, self._q = 0, 0, [float(value) for value in robot.home]
        self._parts = tuple(robot.parts)
        self.service.bus.report_defect = self._note_defect

    def _note_defect(self, what: str, error: Exception) -> str:
        raise AssertionError(f"{self.who}: the handler of {what} failed") from error

    @property
    def run(self) -> str:
        """The present run of robot_sim."""
        return self.service.bus.run if self.who == "robot_sim" else f"r{self._runs}"

    def begin(self) -> None:
        """Begin a new run; robot_sim has one for all inputs."""
        self._runs += 1
        self._k = 0
        self.tick()

    def tick(self) -> None:
        """Publish a tick of 10 ms, and run all handlers that wait."""
        self._k += 1
        if isinstance(self.node, SimNode):
            self.node._tick(0.0)
        else:
            status = PartStatus(k=self._k, t=TICK * self._k, mode="hold", gate="idle", faults=0, epoch=0, cmd_seq=-1, cmd_age=-1)
            shared = {"v": VERSION, "run": self.run, "src": "robot_sim", "seq": self._k, "k": self._k, "t": TICK * self._k, "tw": 0}
            pace = {"dt": TICK, "mode": "free", "rate": 1.0}
            self._put(Clock.stream.key(), encode(Clock(**shared, **pace)), Clock)
            self._put(Tick.stream.key(), encode(Tick(**shared, **pace, q=self._q, parts=dict.fromkeys(self._parts, status))), Tick)
        self.settle()

    def send(self, block: bytes) -> None:
        """Send a message or make a call."""
        if not block:
            return
        entry = self.entries[block[0] % len(self.entries)]
        payload = block[1:].replace(_run_field(RUN), _run_field(self.run))
        if not entry.call:
            self._put(entry.key, payload, entry.cls)
            self.settle()
            return
        replies = self._session.get(entry.key, payload=payload, encoding=encoding_of(entry.cls), attachment=entry.key, timeout=2.0 * WAIT)
        answered, give_up = False, time.monotonic() + WAIT
        while not answered and time.monotonic() < give_up:
            self.settle()
            try:
                answered = replies.try_recv() is not None
            except zenoh.ZError:  # the channel is closed
                break
        if not answered:
            raise AssertionError(f"{self.who}: no reply to {entry.key}")

    def settle(self) -> None:
        """Run all handlers that wait."""
        self.service.spin(time.monotonic())

    def _put(self, key: str, payload: bytes, cls: Any) -> None:
        self._session.put(key, payload, encoding=encoding_of(cls), attachment=key)


def _run_field(run: str) -> bytes:
    return msgspec.msgpack.encode("run") + msgspec.msgpack.encode(run)


def _session() -> zenoh.Session:
    config = zenoh.Config()
    for path, value in _ALONE.items():
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


def _sim_node(service: Service, config: SimConfig, robot: Robot) -> SimNode:
    return SimNode(service, config, robot, make_backend(config, robot))


SERVICES: dict[str, tuple[Any, Callable[[Service, Any, Any], Any]]] = {
    "model": (ModelConfig(), ModelNode),
    "controller": (ControllerConfig(), ControllerNode),
    "robot_sim": (SimConfig(backend="kinematic"), _sim_node),
}
"""The settings of each service, and what makes its node."""

_system = cache(System)


def feeder(who: str) -> Callable[[bytes, Path], bool]:
    """Return what feeds an input to the handlers of a service, and raises if one of them fails or a call has no reply."""

    def feed(content: bytes, folder: Path) -> bool:
        system = _system(who)
        system.begin()
        for block in content.split(DIVIDER)[:MOST_BLOCKS]:
            system.send(block)
        system.tick()
        return True

    return feed


def seeds_of(who: str) -> list[bytes]:
    """Return drawn messages and calls, some in each input."""
    drawer, entries = Drawer(1, {name: len(part) for name, part in ROBOT("icub").parts.items()}), entries_of(who)
    drawer.run, drawer.k, drawer.t = RUN, 1, TICK
    places = {(entry.key, encoding_of(entry.cls)): number for number, entry in enumerate(entries)}
    random_, found, blocks = random.Random(1), list[bytes](), list[bytes]()
    while len(found) < DRAWN:
        drawn = drawer.request() if random_.random() < 0.5 else drawer.message()
        number = places.get((drawn.key, drawn.encoding))
        if number is not None:
            blocks.append(bytes([number]) + drawn.payload)
        if len(blocks) == LENGTH:
            found.append(DIVIDER.join(blocks))
            blocks.clear()
    return found


def main(number: int) -> None:
    """Feed a number of seeds to each service, and print what it refused."""
    for name in SERVICES:
        for seed in seeds_of(name)[:number]:
            feeder(name)(seed, Path())
        print(name, dict(_system(name).service.bus.rejected), flush=True)


if __name__ == "__main__":
    code = 1
    try:
        main(int(sys.argv[1]))
        code = 0
    except Exception:
        traceback.print_exc()
    finally:
        sys.stderr.flush()
        os._exit(code)  # an open session would keep the interpreter from exiting
