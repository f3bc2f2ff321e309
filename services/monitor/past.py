# SPDX-License-Identifier: Apache-2.0
"""The record that a monitor made of a run: every value at every time."""

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
    """The values of one name in the order of their times [s]."""

    times: Sequence[float]
    values: Sequence[Any]

    def at(self, moment: float) -> Any:
        """Return the newest value at a moment; None before the first."""
        index = bisect_right(self.times, moment)
        return self.values[index - 1] if index else None

    def newest(self, moment: float, count: int) -> list[Any]:
        """Return at most `count` newest values at a moment, in order."""
        index = bisect_right(self.times, moment)
        return list(self.values[max(index - count, 0) : index])


class Story:
    """The record of a run."""

    def __init__(self, run: Path) -> None:
        """Read the record in a run's folder; raises MobeeError."""
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
        """Duration of the record, s."""
        return self.end - self.begin

    def at(self, seconds: float) -> dict[str, Any]:
        """Return all values at a moment, s since the beginning."""
        moment = self.begin + min(max(seconds, 0.0), self.length)
        values = {name: value for name, track in self.tracks.items() if (value := track.at(moment)) is not None}
        if "event" in self.tracks:
            values["events"] = self.tracks["event"].newest(moment, SHOWN_EVENTS)
        return values

    def pose(self, seconds: float) -> Array:
        """Return the motor positions (n,) rad at a time [s since the beginning], interpolated linearly between recorded ones."""
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
    """Return an object of the world from its record."""
    turn = quaternion_from_matrix(np.array(recorded["rotation"])[None])[0].tolist()
    geometry = Geometry(recorded["kind"], recorded["size"])
    return ObjectState(recorded["name"], geometry, recorded["position"], turn, recorded["role"], "")
