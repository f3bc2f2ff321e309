# SPDX-License-Identifier: Apache-2.0
"""Reads the record that a monitor made of a run, and returns its values at any time."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bus_schema.messages import Geometry
from bus_schema.rpc import ObjectState
from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.model.kinematics import quaternion_from_matrix
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.common.config import ConfigError, read_toml
from services.monitor.config import Config
from services.monitor.web.record import SHOWN_EVENTS, STORY, Entry, entries


@dataclass(frozen=True)
class Track:
    """All values that were recorded under one name, in the order of time.

    `times`: times of the values [s of the robot's time]. `values`: the values at these times.
    """

    times: Sequence[float]
    values: Sequence[Any]

    def at(self, moment: float) -> Any:
        """Return the newest value at the time `moment` [s]; None if there was no value yet."""
        index = bisect_right(self.times, moment)
        return self.values[index - 1] if index else None

    def newest(self, moment: float, count: int) -> list[Any]:
        """Return the newest values at the time `moment` [s], at most `count`, the oldest first."""
        index = bisect_right(self.times, moment)
        return list(self.values[max(index - count, 0) : index])


class Story:
    """The record of a run: the values that the monitor's page showed during the run.

    `tracks`: the recorded values, by name. `robot`: the robot of the run. `begin`, `end`: times of the first pose and of the last value
    [s of the robot's time].
    """

    def __init__(self, run: Path) -> None:
        """Read the record in the folder `run`, and load the robot that the file `monitor.toml` in this folder names.

        Raises MobeeError if a file cannot be read, the record contains no pose, or its poses have another number of motors than the robot.
        """
        found = entries(run / STORY)
        self.tracks = _tracks(found)
        if "q" not in self.tracks:
            raise MobeeError(f"{run / STORY} holds no pose of the robot: the run ended before it moved.")
        try:
            self.robot: Robot = load_robot(read_toml(run / "monitor.toml", Config).robot)
        except ConfigError as error:
            raise MobeeError(f"{error}: give the folder of a run of `mobee launch`.") from None
        then, now = len(self.tracks["q"].values[0]), len(self.robot.motors)
        if then != now:
            raise MobeeError(f"{run}: the robot had {then} motors then, and {self.robot.name!r} has {now} now.")
        self.begin, self.end = self.tracks["q"].times[0], found[-1].time

    @property
    def length(self) -> float:
        """The duration of the record [s]."""
        return self.end - self.begin

    def at(self, seconds: float) -> dict[str, Any]:
        """Return the newest recorded value of each name at the time `seconds` [s since the begin].

        The value of "events" is a list of the newest events.
        """
        moment = self.begin + min(max(seconds, 0.0), self.length)
        values = {name: value for name, track in self.tracks.items() if (value := track.at(moment)) is not None}
        if "event" in self.tracks:
            values["events"] = self.tracks["event"].newest(moment, SHOWN_EVENTS)
        return values

    def pose(self, seconds: float) -> Array:
        """Return the motor positions (n,) rad at the time `seconds` [s since the begin], interpolated linearly between recorded ones."""
        track, moment = self.tracks["q"], self.begin + min(max(seconds, 0.0), self.length)
        after = min(bisect_right(track.times, moment), len(track.times) - 1)
        before = max(after - 1, 0)
        span = track.times[after] - track.times[before]
        share = min(max((moment - track.times[before]) / span, 0.0), 1.0) if span > 0.0 else 1.0
        q: Array = (1.0 - share) * np.array(track.values[before]) + share * np.array(track.values[after])
        return q


def _tracks(found: Sequence[Entry]) -> dict[str, Track]:
    lists: dict[str, tuple[list[float], list[Any]]] = {}
    for one in found:
        times, values = lists.setdefault(one.name, ([], []))
        times.append(one.time)
        values.append(one.value)
    return {name: Track(times, values) for name, (times, values) in lists.items()}


def object_of(recorded: Mapping[str, Any]) -> ObjectState:
    """Convert the record of an object of the world, JSON data as returned by `services.monitor.web.body.thing`, to ObjectState."""
    turn = quaternion_from_matrix(np.array(recorded["rotation"])[None])[0].tolist()
    geometry = Geometry(recorded["kind"], recorded["size"])
    return ObjectState(recorded["name"], geometry, recorded["position"], turn, recorded["role"], "")
