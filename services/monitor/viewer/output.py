# SPDX-License-Identifier: Apache-2.0
"""The outputs of the monitor: a web page, a recording, or both."""

from __future__ import annotations

import secrets
import shutil
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any, NoReturn

import rerun as rr

from mobee.robot.robot import Robot
from services.common.exit_codes import BAD_INPUT
from services.monitor.config import Config
from services.monitor.viewer.blueprint import blueprint, shown_of
from services.monitor.viewer.files import ViewerFiles
from services.monitor.viewer.frames import Frames
from services.monitor.web.board import Board
from services.monitor.web.record import STORY, Record
from services.monitor.web.server import Controls, PageServer, Refused, Site
from services.monitor.web.surfaces import surfaces_of

HOST = "127.0.0.1"
BATCH = timedelta(seconds=2)  # of a recording: written one by one, updates of the robot take six times the room
RECORDING, KEY = "recording", "page.key"  # in the folder of a run; the former without suffix
ROOM = 20_000_000  # bytes that must be free at the start of a recording: Rerun may wait without end for a disk that is full


class NoControls:
    """Controls that refuse all commands. They are used by a replay, and by a page whose monitor is not yet on the bus."""

    def do(self, page: str, verb: str, arguments: dict[str, Any]) -> str:
        """Raise Refused: no command can be executed."""
        raise Refused("the page cannot do that now")

    def tend(self, open_pages: set[str]) -> None:
        """Do nothing: these controls refuse all commands, so a page never controls a part that must be given back to its agent."""


class LaterControls:
    """Forwards the commands of the page to `real`.

    The monitor sets `real` when it is on the bus. Until then, all commands are refused (`NoControls`).
    """

    def __init__(self) -> None:
        self.real: Controls = NoControls()

    def do(self, page: str, verb: str, arguments: dict[str, Any]) -> str:
        """Execute the command `verb` of the page with the id `page`, and return a sentence for the user.

        The attribute `real` (the monitor's controls) executes it. `arguments`: values of the command, by name. Raises Refused if it cannot
        be executed.
        """
        return self.real.do(page, verb, arguments)

    def tend(self, open_pages: set[str]) -> None:
        """Pass the ids of the open pages to the attribute `real` (the monitor's controls).

        If a page that controlled parts of the robot has been closed, the monitor's controls give these parts back to their agents.
        """
        self.real.tend(open_pages)


@dataclass(frozen=True)
class Output:
    """The outputs of the monitor.

    `frames`: stream to the 3D view and to the recording. `board`: values of the page. `record`: file of these values; None: not recorded.
    `server`: web server of the page; None: no page. `controls`: executes the page's commands. `url`: address of the page; empty: no page.
    """

    frames: Frames
    board: Board
    record: Record | None
    server: PageServer | None
    controls: LaterControls
    url: str


@contextmanager
def open_output(config: Config, robot: Robot, now: Callable[[], float]) -> Iterator[Output]:
    """Open the outputs of the monitor, as a context manager that closes them at the end of the `with` block.

    The outputs are the page if `config.serve` is set, and a recording if `config.run_dir` is set. `now`: returns the robot's time [s].
    Prints one line on standard error and raises SystemExit with code 2 if the port is in use, or `run_dir` is no folder.
    """
    folder, layout = _folder_of(config), blueprint(shown_of(robot, list(config.cameras_on(robot))))
    with tempfile.TemporaryDirectory(prefix="mobee-page-", ignore_cleanup_errors=True) as private:
        record = Record(folder / STORY, now) if folder else None
        board = Board(record.put if record else None)
        controls = LaterControls()
        identity = f"mobee-{secrets.token_hex(4)}"
        file = None
        if folder is not None and _has_room(folder):
            file = rr.RecordingStream("mobee", recording_id=identity, batcher_config=_in_batches())
            sink = rr.FileSink(_new_recording(folder), write_footer=False)  # a footer would be kept in memory until the end
            file.set_sinks(sink, default_blueprint=layout)
        frames = Frames(file, layout, identity)
        server, url = None, ""
        try:
            if config.serve:
                key = _key_of(folder)
                site = Site(board, key, controls, frames, ViewerFiles(Path(private)).path, now, surfaces=surfaces_of(robot))
                server = serve(site, config.bind, config.web_port)
                url = f"http://{HOST}:{config.web_port}/?key={key}"
            yield Output(frames, board, record, server, controls, url)
        finally:
            if server is not None:
                server.close()
            if record is not None:
                record.close()
            frames.close()
            if file is not None:
                file.disconnect()


def _in_batches() -> rr.ChunkBatcherConfig:
    batches = rr.ChunkBatcherConfig()
    batches.flush_tick = BATCH
    return batches


def _key_of(folder: Path | None) -> str:
    """Return a new key, or that of the monitor that ran before in the folder: its pages stay open when it is started again."""
    key = secrets.token_urlsafe(9)
    if folder is None:
        return key
    file = folder / KEY
    if file.exists() and (kept := file.read_text()):  # it is empty if the disk was full: then everyone would have it
        return kept
    with suppress(OSError):  # the page needs no file
        file.touch(mode=0o600)
        file.write_text(key)
    return key


def _has_room(folder: Path) -> bool:
    """Return whether the disk has room for a recording; print the reason if it has not."""
    free = shutil.disk_usage(folder).free
    if free < ROOM:
        print(f"the 3D view is not recorded: {folder} has {free / 1e6:.0f} MB left, and needs {ROOM / 1e6:.0f}", file=sys.stderr)
    return free >= ROOM


def _new_recording(folder: Path) -> Path:
    """Return the path of a new recording: a monitor that is started again must not overwrite that of the monitor before."""
    number = 1
    while (path := folder / f"{RECORDING}{f'-{number}' if number > 1 else ''}.rrd").exists():
        number += 1
    return path


def serve(site: Site, bind: str, port: int) -> PageServer:
    """Serve a page at an address and port, and return its server.

    `bind`: address of the network interface, as "127.0.0.1". If the port is in use, the call tries again for 1 s, because a program that
    has just ended may still occupy it. If the port is still in use then, the call prints one line on standard error and raises SystemExit
    with code 2.
    """
    give_up = time.monotonic() + 1.0
    while True:
        try:
            _require_free(bind, port)
            return PageServer(site, bind, port)
        except OSError:
            if time.monotonic() > give_up:
                _refuse(f"web_port {port} is in use: end the other system with `mobee stop`, or choose another web_port")
        time.sleep(0.05)


def _require_free(bind: str, port: int) -> None:
    """Raise OSError if another program listens, also where Python's server would share the port with it."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((bind, port))


def _folder_of(config: Config) -> Path | None:
    folder = Path(config.run_dir) if config.run_dir else None
    if folder is not None and not folder.is_dir():
        _refuse(f"run_dir {folder} is not a folder: make it, or set run_dir to an empty text for no recording")
    return folder


def _refuse(text: str) -> NoReturn:
    print(f"services.monitor: {text}", file=sys.stderr)
    raise SystemExit(BAD_INPUT)
