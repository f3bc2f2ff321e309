# SPDX-License-Identifier: Apache-2.0
"""A separate bus on which one service of a recording runs again. The messages of all other services are played from the recording."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from queue import Empty, Queue
from typing import Any, Self

import msgspec

from bus_schema import VERSION, encoding_of, keys
from bus_schema.page import streams
from mobee.errors import MobeeError
from mobee_cli.replaying.ticks import Item
from services.common.observe import alive
from services.common.session import LOCAL_ENDPOINT, local_endpoint, open_router, spare_threads
from services.common.tap import Raw, RawPublisher, answer_raw, call_raw, receive_raw
from services.launcher.catalogue import entry_of

READY = 60.0  # s until the service is ready
PATIENCE = 10.0  # s for an answer of the service
PLAYER = "replay"


class Stopped(MobeeError):
    """Raised if the service on the stage ends, or does not answer in time."""


class Stage:
    """A separate bus with one service on it, for the replay of a recording.

    `who`: name of the service. `said`: queue of the messages that the service publishes.
    """

    def __init__(self, who: str, settings: str, folder: Path) -> None:
        """Prepare the stage.

        `who`: name of the service. `settings`: content of its settings file in the recorded run. `folder`: for this file and the log.
        """
        self.who, self._folder, self._settings = who, folder, settings
        self.said: Queue[Item] = Queue()  # messages of the service
        self._tokens: dict[tuple[str, str], Any] = {}
        self._kept: list[Any] = []
        self._ready = False
        self._process: subprocess.Popen[bytes] | None = None

    @contextmanager
    def open(self, endpoint: str) -> Iterator[Self]:
        """Open the bus, with a router of its own, for the block of a `with` statement. At the end of the block the service is stopped.

        The router listens at a Unix socket. It listens at `endpoint` only if the system has no such sockets, or the socket's path is too
        long.
        """
        spare_threads()
        with local_endpoint() as local, open_router(local or endpoint, lease=PATIENCE) as session:
            self.session, self._endpoint = session, local or endpoint
            self._publisher = RawPublisher(session)
            self.token("router", PLAYER, up=True)
            for key in {cls.stream.keys() for cls in streams()}:
                self._kept.append(receive_raw(session, key, self._hear))
            try:
                yield self
            finally:
                self._end()

    def start(self) -> None:
        """Start the service with its settings in the recorded run, and wait until it is ready.

        Raises Stopped if it ends, or is not ready within 60 s.
        """
        entry = entry_of(self.who, None)
        assert entry is not None
        file = self._folder / f"{self.who}.toml"
        file.write_text(self._settings, encoding="utf-8")
        argv = [sys.executable, "-m", "mobee_system.run", entry.module, "--config", str(file), "--endpoint", self._endpoint]
        self._log = self._folder / f"{self.who}.log"
        with self._log.open("wb") as log:
            self._process = subprocess.Popen(
                argv, stdin=subprocess.DEVNULL, stdout=log, stderr=log, env={**os.environ, LOCAL_ENDPOINT: self._endpoint}
            )
        give_up = time.monotonic() + READY
        while not self._has_token():
            self.check()
            if time.monotonic() > give_up:
                raise Stopped(f"{self.who} is not ready within {READY:g} s; its log is {self._log}")
            time.sleep(0.02)

    def check(self) -> None:
        """Raise Stopped if the service has ended by itself."""
        if self._process is not None and self._process.poll() is not None:
            lines = self._log.read_text(errors="replace").strip().splitlines()
            raise Stopped(f"{self.who} ended with code {self._process.returncode}: {(lines or ['its log is empty'])[-1]}")

    def next(self, seconds: float) -> Item | None:
        """Return the next message of the service; None if no message arrives within `seconds`."""
        try:
            return self.said.get(timeout=seconds)
        except Empty:
            return None

    def send(self, key: str, encoding: str, payload: bytes) -> None:
        """Publish a message with this key, encoding and content on the separate bus."""
        self._publisher.put(key, encoding, payload)

    def token(self, who: str, instance: str, up: bool) -> None:
        """Declare (`up`) or remove the liveliness token of a process. `who`: name of the service; `instance`: id of the process."""
        if up and (who, instance) not in self._tokens:
            self._tokens[who, instance] = self.session.liveliness().declare_token(keys.alive(who, instance))
        elif not up and (who, instance) in self._tokens:
            self._tokens.pop((who, instance)).undeclare()

    def serve(self, key: str, answer: Callable[[str, dict[str, Any]], tuple[type[msgspec.Struct], bytes] | None]) -> None:
        """Answer the calls that the service makes to other services.

        `key`: key expression of the calls. `answer(key, request)` returns the type and the bytes of the reply, or None: no answer.
        """

        def reply(at: str, request: bytes) -> tuple[str, bytes] | None:
            found = answer(at, msgspec.msgpack.decode(request))
            return None if found is None else (encoding_of(found[0]), found[1])

        self._kept.append(answer_raw(self.session, key, reply))

    def call(self, key: str, kind: str, request: bytes) -> tuple[str, bytes]:
        """Make a recorded call to the service, and return the encoding string and the bytes of the answer.

        `key`: key of the call. `kind`: name of the request's type. `request`: bytes of the request. Raises Stopped if there is no answer
        within 10 s.
        """
        answer = call_raw(self.session, key, f"application/msgpack;icub/{kind}/{VERSION}", request, PATIENCE)
        if answer is None:
            self.check()
            raise Stopped(f"{self.who} did not answer {key} within {PATIENCE:g} s; its log is {self._log}")
        return answer

    def _hear(self, raw: Raw) -> None:
        self.said.put(Item(raw, self.who))

    def _has_token(self) -> bool:
        return self.who in alive(self.session)

    def _end(self) -> None:
        if self._process is not None and self._process.poll() is None:
            self._process.terminate()
            try:
                self._process.wait(5.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()
