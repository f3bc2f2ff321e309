# SPDX-License-Identifier: Apache-2.0
"""A launcher with toy services as real processes, and what is left of them."""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import psutil

ROOT = Path(__file__).parents[3]


def toys(**behaviours: str) -> str:
    """A scenario with one toy a name; `behaviours`: name -> behaviour."""
    tables = (
        f'[services.{name}]\nmodule = "tests.services.toy_service"\nname = "{name}"\nbehaviour = "{behaviour}"\n'
        for name, behaviour in behaviours.items()
    )
    return 'title = "toys"\n\n' + "\n".join(tables)


class Launched:
    """`mobee launch` of a scenario text, in a folder of its own, at an endpoint of its own; None: it joins that of another."""

    def __init__(self, folder: Path, endpoint: str | None, scenario: str, *options: str) -> None:
        self.folder, self.endpoint = folder, endpoint
        file = folder / "toys.toml"
        file.write_text(scenario)
        argv = [sys.executable, "-m", "mobee_cli", "launch", str(file), "--json", "--runs", str(folder / "runs")]
        argv += ["--endpoint", endpoint] if endpoint else []
        self._news = (folder / "news").open("wb+")
        self.process = subprocess.Popen([*argv, *options], stdout=subprocess.PIPE, stderr=self._news, cwd=ROOT)

    @property
    def news(self) -> str:
        """What it said on standard error so far."""
        return (self.folder / "news").read_text()

    def wait_for(self, said: str, timeout: float = 60.0) -> None:
        wait_until(lambda: said in self.news or self.process.poll() is not None, timeout)
        assert said in self.news, self.news

    def end(self, timeout: float = 60.0) -> tuple[int, dict[str, Any]]:
        """Exit code and summary."""
        out, _ = self.process.communicate(timeout=timeout)
        return self.process.returncode, json.loads(out) if out else {}

    def children(self) -> list[psutil.Process]:
        """The processes of its services, found by the folder in their arguments: also when the launcher is gone."""
        return [
            process for process in psutil.process_iter(["cmdline"]) if f"{self.folder}/runs/" in " ".join(process.info["cmdline"] or ())
        ]

    def leave_nothing(self) -> None:
        """For the end of a test, however it went."""
        for process in [psutil.Process(self.process.pid)] if self.process.poll() is None else []:
            process.kill()
        for process in self.children():
            process.kill()
        self.process.wait()
        self._news.close()


def is_free(port: int) -> bool:
    """Whether the TCP port is free to listen on."""
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


def wait_until(condition: Callable[[], bool], timeout: float) -> None:
    give_up = time.monotonic() + timeout
    while not condition() and time.monotonic() < give_up:
        time.sleep(0.02)


def mobee(*arguments: str, timeout: float = 60.0) -> subprocess.CompletedProcess[str]:
    """Run the command to its end, in a terminal of 80 columns."""
    environment = {**os.environ, "COLUMNS": "80"}
    return subprocess.run(
        [sys.executable, "-m", "mobee_cli", *arguments], capture_output=True, text=True, timeout=timeout, cwd=ROOT, env=environment
    )
