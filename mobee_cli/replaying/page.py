# SPDX-License-Identifier: Apache-2.0
"""Plays a recording to a separate monitor, which shows the run on its page, at the speed of the robot's time."""

from __future__ import annotations

import json
import time
import tomllib
from pathlib import Path
from typing import Any

import msgspec

from bus_schema import VERSION, encode, encoding_of, keys
from bus_schema.messages import Clock, Message, PartStatus, State, Tick
from bus_schema.rpc import World
from mobee.errors import MobeeError
from mobee.robot.load import load_robot
from mobee_cli.replaying.stage import Stage
from mobee_cli.replaying.ticks import served_of
from services.common.tap import Raw
from services.common.worlds import object_state, world_around
from services.recorder.reader import Recording

STATE_PERIOD = 50_000_000  # ns of the robot's time between two states of its parts
_HEADER = ("v", "run", "src", "seq", "k", "t", "tw")
_MADE = ("Clock", "State")  # made from the ticks, because most recordings do not have them
_tick = msgspec.msgpack.Decoder(Tick)


class Player:
    """Plays a recording to a monitor. `stage`: the separate bus on which this monitor runs."""

    def __init__(self, recording: Recording, port: int, folder: Path) -> None:
        """Prepare the monitor.

        `port`: of its page. `folder`: for its files. Raises MobeeError if the recording does not contain the settings of its run.
        """
        settings = recording.settings()
        if "robot_sim.toml" not in settings:
            raise MobeeError("the recording holds no robot_sim.toml, the settings of the robot: was it made by `mobee launch`?")
        given = tomllib.loads(settings["robot_sim.toml"])
        self._recording, self._robot = recording, load_robot(given["robot"])
        self._world = encode(_described(given.get("world", ""), given["robot"]))
        self.stage = Stage("monitor", f"robot = {json.dumps(given['robot'])}\nweb_port = {port}\n", folder)
        self._next_state = self._offset = self._last = 0  # ns of the robot's time

    def play(self, speed: float) -> None:
        """Publish all messages of the recording.

        `speed`: seconds of the robot's time that are replayed in one second; 1: real time. If the robot was paused, its time stood still,
        so the replay does not wait there.
        """
        self.stage.serve(keys.world_rpc("list"), lambda key, request: (World, self._world))
        begin, first = time.monotonic(), -1
        for message in self._recording:
            if message.type == "Tick":
                tick = _tick.decode(message.payload)
                t = self._time_of(tick)
                first = t if first < 0 else first
                time.sleep(max(0.0, begin + 1e-9 * (t - first) / speed - time.monotonic()))
                self.stage.check()
                self._make(tick, t)
            self._publish(message)

    def _time_of(self, tick: Tick) -> int:
        """Return the time of a tick, ns since the beginning; a later run continues the time of the run before it."""
        if self._offset + tick.t < self._last:
            self._offset = self._last
        self._last = self._offset + tick.t
        return self._last

    def _publish(self, message: Raw) -> None:
        if not message.type:
            token = json.loads(message.payload)
            if token["who"] not in ("monitor", "router"):
                self.stage.token(token["who"], token["instance"], token["up"])
        elif message.type == "Served":
            served = served_of(message)
            if served and served.key == keys.world_rpc("list") and served.reply_type == World.__name__:
                self._world = served.reply
        elif message.type not in _MADE:
            self.stage.send(message.key, message.encoding, message.payload)

    def _make(self, tick: Tick, t: int) -> None:
        """Publish the clock and states that the monitor reads, from the content of a recorded tick."""
        header = {name: getattr(tick, name) for name in _HEADER}
        self._send(Clock(**header, dt=tick.dt, mode=tick.mode, rate=tick.rate))
        if t < self._next_state or tick.parts.keys() != self._robot.parts.keys():
            return
        self._next_state = t + STATE_PERIOD
        for name, part in self._robot.parts.items():
            status, still = _fields(tick.parts[name]), [0.0] * len(part)
            self._send(State(**{**header, **status}, q=tick.q[part.slice], dq=still, tau=still), name)

    def _send(self, message: Message, name: str = "") -> None:
        self.stage.send(type(message).stream.key(name), encoding_of(type(message)), encode(message))


def _fields(status: PartStatus) -> dict[str, Any]:
    return {name: getattr(status, name) for name in PartStatus.__struct_fields__}


def _described(world: str, robot: str) -> World:
    """Return the objects of a world as the model lists them."""
    return World(v=VERSION, objects=[object_state(thing) for thing in world_around(world, robot).objects.values()])
