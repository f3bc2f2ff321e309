# SPDX-License-Identifier: Apache-2.0
"""Replays a run on the page of the monitor, with a time line, from the values of the page that the monitor recorded."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np

from bus_schema.messages import ContactItem
from services.monitor.past import Story, object_of
from services.monitor.viewer.blueprint import TIMELINE, blueprint, shown_of
from services.monitor.viewer.files import ViewerFiles
from services.monitor.viewer.frames import Frames
from services.monitor.viewer.output import HOST, NoControls, serve
from services.monitor.viewer.scene import Scene
from services.monitor.web.board import Board
from services.monitor.web.body import body_at
from services.monitor.web.server import Site
from services.monitor.web.surfaces import surfaces_of

PERIOD = 0.1  # s between two pictures
NOT_SHOWN = ("q", "contacts", "event")  # on the page they are the body, and the events


class Player:
    """The state of a replay: its position in the record of a run, and whether it is playing or paused. Any thread may call its methods."""

    def __init__(self, story: Story) -> None:
        self.story = story
        self._lock = Lock()
        self._at, self._plays, self._since = 0.0, True, time.monotonic()

    def seek(self, query: Mapping[str, str]) -> None:
        """Execute a command of the page's time line: "at" sets the position [s since the begin], "toggle" starts or pauses the replay.

        Raises ValueError if "at" is not a number. `query`: the command, a dict with one of these keys.
        """
        with self._lock:
            self._advance()
            if "at" in query:
                wanted = float(query["at"])
                if math.isnan(wanted):
                    raise ValueError("at=nan is not a position")
                self._at = min(max(wanted, 0.0), self.story.length)
            if "toggle" in query:
                self._plays = not self._plays
                if self._plays and self._at >= self.story.length:
                    self._at = 0.0

    def now(self) -> tuple[float, bool]:
        """Return the current position [s since the begin], and whether the replay plays."""
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


def replay(run: Path, port: int, report: Callable[[str], None]) -> None:
    """Serve the page of a recorded run until the user interrupts with Ctrl-C.

    `run`: folder of the run. `port`: TCP port of the page. `report` is called with the page's address. Raises MobeeError if the record
    cannot be read.
    """
    story = Story(run)
    player, board = Player(story), Board()
    with tempfile.TemporaryDirectory(prefix="mobee-page-") as private:
        frames = Frames(None, blueprint(shown_of(story.robot), in_motion=False), "replay")
        scene = Scene(frames, story.robot)
        files, surfaces = ViewerFiles(Path(private)).path, surfaces_of(story.robot)
        site = Site(board, "", NoControls(), frames, files, lambda: player.now()[0], seek=player.seek, surfaces=surfaces)
        server = serve(site, HOST, port)
        report(f"http://{HOST}:{server.port}/")
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
    values, shown = story.at(at), shown_of(story.robot)
    camera = {"eye": shown.eye.tolist(), "target": shown.target.tolist()}
    q = np.array(values["q"])
    contacts = [_contact(one) for one in values.get("contacts", [])]
    board.put("player", {"at": round(at, 1), "length": round(story.length, 1), "plays": plays})
    for name, value in values.items():
        if name not in NOT_SHOWN:
            board.put(name, value | camera if name == "robot" else value)
    board.put("body", {"t": round(at, 2), "q": values["q"], **body_at(story.robot, q, contacts)})
    frames.set_time(TIMELINE, clock)  # not the time of the story: a viewer shows the newest time, also after a step back
    scene.set_objects([object_of(one) for one in values.get("objects", [])])
    frames.begin_update()
    scene.log_robot(q, contacts)
    frames.end_update()


def _contact(one: Mapping[str, Any]) -> ContactItem:
    return ContactItem(one["first"], one["second"], one["kind"], 0.0, one["point"], [0.0, 0.0, 1.0], -1, -1)
