# SPDX-License-Identifier: Apache-2.0
"""Extracts the files of Rerun's browser viewer from the program `rerun`, which is part of Rerun's Python package."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import time
import urllib.error
import urllib.request
from importlib.util import find_spec
from pathlib import Path
from threading import Lock

from services.monitor.web.server import VIEWER_FILES

TIMEOUT = 30.0  # s


def program() -> Path:
    """Return the path of the program `rerun`; raises SystemExit if Rerun is not installed."""
    spec = find_spec("rerun_cli")
    if spec is None or spec.origin is None:
        raise SystemExit('the page needs rerun-sdk: pip install "mobee[viz]"')
    return Path(spec.origin).parent / "rerun"


class ViewerFiles:
    """The files of Rerun's browser viewer in a folder. They are extracted when the first one is requested."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._lock = folder, Lock()

    def path(self, name: str) -> Path:
        """Return the path of the viewer's file `name`, such as re_viewer.js. Any thread may call this."""
        with self._lock:
            if not (self._folder / name).is_file():
                self._extract()
        return self._folder / name

    def _extract(self) -> None:
        """Run the web server of the program Rerun on loopback for a moment, and copy the viewer's files from it to the folder.

        The program runs without the user's settings and without sending usage data.
        """
        private = {**os.environ, "RUST_LOG": "off", "XDG_CONFIG_HOME": str(self._folder), "XDG_DATA_HOME": str(self._folder)}
        subprocess.run([program(), "analytics", "disable"], env=private, capture_output=True, check=True, timeout=TIMEOUT)
        web, data = _free_ports()
        command = [str(program()), "--serve-web", "--bind", "127.0.0.1", "--port", str(data), "--web-viewer-port", str(web)]
        quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
        with subprocess.Popen(command, env=private, **quiet) as serving:  # type: ignore[call-overload]  # the three streams
            try:
                for name in VIEWER_FILES:
                    _download(f"http://127.0.0.1:{web}/{name}", self._folder / name)
            finally:
                serving.kill()


def _download(url: str, to: Path) -> None:
    give_up = time.monotonic() + TIMEOUT
    part = to.with_suffix(".part")
    while True:
        try:
            with urllib.request.urlopen(url, timeout=TIMEOUT) as answer, part.open("wb") as file:
                shutil.copyfileobj(answer, file, 1 << 20)
            part.rename(to)
            return
        except urllib.error.URLError:
            if time.monotonic() > give_up:
                raise
        time.sleep(0.05)


def _free_ports() -> tuple[int, int]:
    """Return two free ports on the loopback interface."""
    with socket.socket() as first, socket.socket() as second:
        for probe in (first, second):
            probe.bind(("127.0.0.1", 0))
        return int(first.getsockname()[1]), int(second.getsockname()[1])
