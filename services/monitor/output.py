# SPDX-License-Identifier: Apache-2.0
"""Outputs of the monitor: a page on loopback, a recording, or both."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import rerun as rr
import rerun.blueprint as rrb

from services.common.exit_codes import BAD_INPUT
from services.monitor.config import Config
from services.monitor.page import HOST, program

START_TIMEOUT = 10.0  # s until the page answers


@dataclass(frozen=True)
class Output:
    """An open recording stream and, if a page is served, its process and address."""

    stream: rr.RecordingStream
    page: subprocess.Popen[bytes] | None
    url: str


@contextmanager
def open_output(config: Config, layout: rrb.Blueprint, recording: Path | None) -> Iterator[Output]:
    """Serve as configured, and record to a file if one is named; exits with code 2 and one line if a port cannot be used."""
    with tempfile.TemporaryDirectory(prefix="mobee-page-", ignore_cleanup_errors=True) as private:
        page = _start_page(config, private) if config.serve else None
        stream = rr.RecordingStream("mobee")
        try:
            _connect(stream, config, layout, recording)
            yield Output(stream, page, page_url(config) if page else "")
        finally:
            if page is not None:
                page.kill()  # before disconnect, which would wait for a page that hangs
                page.wait()
            stream.disconnect()


def recording_of(config: Config) -> Path | None:
    """The file that is recorded to; exits with code 2 and one line if its folder is missing."""
    folder = Path(config.run_dir) if config.run_dir else None
    if folder is not None and not folder.is_dir():
        _refuse(f"run_dir {folder} is not a folder: make it, or set run_dir to an empty text for no recording")
    return folder / "recording.rrd" if folder else None


def _connect(stream: rr.RecordingStream, config: Config, layout: rrb.Blueprint, recording: Path | None) -> None:
    sinks: list[rr.GrpcSink | rr.FileSink] = []
    if config.serve:
        sinks.append(rr.GrpcSink(f"rerun+http://{HOST}:{config.grpc_port}/proxy"))
    if recording is not None:
        sinks.append(rr.FileSink(recording))
    if sinks:
        stream.set_sinks(*sinks, default_blueprint=layout)


def page_url(config: Config) -> str:
    """The address of the page."""
    source = quote(f"rerun+http://{HOST}:{config.grpc_port}/proxy", safe="")
    return f"http://{HOST}:{config.web_port}/?url={source}"


def _start_page(config: Config, folder: str) -> subprocess.Popen[bytes]:
    for name, port in (("web_port", config.web_port), ("grpc_port", config.grpc_port)):
        _require_free(config, name, port)
    words = [str(os.getpid()), config.bind, str(config.web_port), str(config.grpc_port), config.memory_limit]
    command = [sys.executable, "-m", "mobee_system.run", "services.monitor.page", *words]
    page = subprocess.Popen(command, stdin=subprocess.DEVNULL, env=_private(folder))
    give_up = time.monotonic() + START_TIMEOUT
    while not all(_answers(port) for port in (config.web_port, config.grpc_port)):
        if page.poll() is not None or time.monotonic() > give_up:
            page.kill()
            _refuse(f"the page did not start at port {config.web_port} within {START_TIMEOUT:g} s; set serve = false to run without it")
        time.sleep(0.05)
    return page


def _private(folder: str) -> dict[str, str]:
    """An environment in which Rerun's program sends no usage data and reads no settings of the user."""
    surroundings = {**os.environ, "RUST_LOG": "error", "XDG_CONFIG_HOME": folder, "XDG_DATA_HOME": folder}
    subprocess.run([program(), "analytics", "disable"], env=surroundings, capture_output=True, check=True, timeout=START_TIMEOUT)
    return surroundings


def _require_free(config: Config, name: str, port: int) -> None:
    """Wait for the port: a page that was just killed may hold it for a moment."""
    give_up = time.monotonic() + 1.0
    while True:
        with socket.socket() as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            try:
                probe.bind((config.bind, port))
                return
            except OSError:
                if time.monotonic() > give_up:
                    _refuse(f"{name} {port} is in use: end the other system with `mobee stop`, or choose another {name}")
        time.sleep(0.05)


def _answers(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex((HOST, port)) == 0


def _refuse(text: str) -> None:
    print(f"services.monitor: {text}", file=sys.stderr)
    raise SystemExit(BAD_INPUT)
