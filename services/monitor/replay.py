# SPDX-License-Identifier: Apache-2.0
"""Shows again what a monitor recorded: the same page, with a time line."""

from __future__ import annotations

import tempfile
import time
from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from bus_schema.messages import ContactItem, Geometry
from bus_schema.rpc import ObjectState
from mobee.errors import MobeeError
from mobee.model.kinematics import quaternion_from_matrix
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.common.config import ConfigError, read_toml
from services.monitor.config import Config
from services.monitor.viewer.blueprint import TIMELINE, blueprint, shown_of
from services.monitor.viewer.files import ViewerFiles
from services.monitor.viewer.frames import Frames
from services.monitor.viewer.output import HOST, STORY, NoControls, serve
from services.monitor.viewer.scene import Scene
from services.monitor.web.board import Board
from services.monitor.web.body import look
from services.monitor.web.record import Entry, entries
from services.monitor.web.server import Site

PERIOD = 0.1  # s between two pictures
NOT_SHOWN = ("q", "contacts")  # on the page they are the body


@dataclass(frozen=True)
class Track:
    """The values that something had, in the order of their times [s]."""

    times: Sequence[float]
    values: Sequence[Any]

    def at(self, moment: float) -> Any:
        """Return the newest value at a moment; None before the first."""
        index = bisect_right(self.times, moment)
        return self.values[index - 1] if index else None


class Story:
    """What was recorded of a run."""

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
        if len(self.tracks["q"].values[0]) != len(self.robot.motors):
            raise MobeeError(
                f"{run}: the robot had {len(self.tracks['q'].values[0])} motors then, {self.robot.name!r} has {len(self.robot.motors)}."
            )
        self.begin, self.end = self.tracks["q"].times[0], found[-1].time

    @property
    def length(self) -> float:
        """Duration of the record, s."""
        return self.end - self.begin

    def at(self, seconds: float) -> dict[str, Any]:
        """Return all values at a moment, s since the begin."""
        moment = self.begin + min(max(seconds, 0.0), self.length)
        return {name: value for name, track in self.tracks.items() if (value := track.at(moment)) is not None}


def _tracks(found: Sequence[Entry]) -> dict[str, Track]:
    lists: dict[str, tuple[list[float], list[Any]]] = {}
    for one in found:
        times, values = lists.setdefault(one.name, ([], []))
        times.append(one.time)
        values.append(one.value)
    return {name: Track(times, values) for name, (times, values) in lists.items()}


class Player:
    """The position in a story; any thread may change it."""

    def __init__(self, story: Story) -> None:
        self.story = story
        self._lock = Lock()
        self._at, self._plays, self._since = 0.0, True, time.monotonic()

    def seek(self, query: Mapping[str, str]) -> None:
        """Do what the page's time line asks for: `at`, s since the begin, or `toggle` between playing and a pause.  Raises ValueError."""
        with self._lock:
            self._advance()
            if "at" in query:
                self._at = min(max(float(query["at"]), 0.0), self.story.length)
            if "toggle" in query:
                self._plays = not self._plays
                if self._plays and self._at >= self.story.length:
                    self._at = 0.0

    def now(self) -> tuple[float, bool]:
        """Return the position, s since the begin, and whether it plays."""
        with self._lock:
            self._advance()
            return self._at, self._plays

    def _advance(self) -> None:
        now = time.monotonic()
        if self._plays:
            self._at += now - self._since
        self._since = now
        if self._at >= self.story.length:
            self._at, self._plays = self.story.length, False


def replay(run: Path, port: int, tell: Callable[[str], None]) -> None:
    """Serve the page of a run until the user interrupts; `tell` is called with its address.  Raises MobeeError."""
    story = Story(run)
    player, board = Player(story), Board()
    with tempfile.TemporaryDirectory(prefix="mobee-page-") as private:
        frames = Frames(None, blueprint(shown_of(story.robot), in_motion=False), "replay")
        scene = Scene(frames, story.robot)
        site = Site(board, "", NoControls(), frames, ViewerFiles(Path(private)).path, lambda: player.now()[0], seek=player.seek)
        server = serve(site, HOST, port)
        tell(f"http://{HOST}:{server.port}/")
        begin = time.monotonic()
        try:
            while True:
                _show(story, player, board, frames, scene, time.monotonic() - begin)
                time.sleep(PERIOD)
        finally:
            server.close()
            frames.close()


def _show(story: Story, player: Player, board: Board, frames: Frames, scene: Scene, clock: float) -> None:
    at, plays = player.now()
    values = story.at(at)
    q = np.array(values["q"])
    contacts = [_contact(one) for one in values.get("contacts", [])]
    board.put("player", {"at": round(at, 1), "length": round(story.length, 1), "plays": plays})
    for name, value in values.items():
        if name not in NOT_SHOWN:
            board.put(name, value)
    board.put("body", {"t": round(at, 2), "q": values["q"], **look(story.robot, q, contacts)})
    frames.set_time(TIMELINE, clock)  # not the time of the story: a viewer shows the newest time, also after a step back
    scene.set_objects([_thing(one) for one in values.get("objects", [])])
    frames.begin_look()
    scene.log_robot(q, contacts)
    frames.end_look()


def _contact(one: Mapping[str, Any]) -> ContactItem:
    return ContactItem(one["first"], one["second"], one["kind"], 0.0, one["point"], [0.0, 0.0, 1.0], -1, -1)


def _thing(one: Mapping[str, Any]) -> ObjectState:
    turn = quaternion_from_matrix(np.array(one["rotation"])[None])[0].tolist()
    return ObjectState(one["name"], Geometry(one["kind"], one["size"]), one["position"], turn, one["role"], "")
