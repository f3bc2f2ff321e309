# SPDX-License-Identifier: Apache-2.0
"""A service as a child process of the launcher: starts it, measures how long it has been silent, and ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, Protocol

from bus_schema.rpc import Stat
from services.common.entry import HELD
from services.launcher.starvation import Starvation

Phase = Literal["waiting", "starting", "ready", "failed", "fault", "ended"]

_ONE_THREAD = {
    f"{pool}_NUM_THREADS": "1" for pool in ("OMP", "OPENBLAS", "MKL", "RAYON", "NUMEXPR", "VECLIB_MAXIMUM")
}  # the processes are the parallelism


class Watched(Protocol):
    """The state of a service that runs on this host or on another one, as the launcher reports it."""

    @property
    def who(self) -> str:
        """The name of the service."""

    @property
    def host(self) -> str:
        """The name of the other host that has started the service. Empty: this host has started it, or the host is not known."""

    @property
    def phase(self) -> Phase:
        """The phase of the service: waiting (for other services), starting, ready, failed (to be restarted), fault (given up), ended."""

    @property
    def pid(self) -> int:
        """The process id on the host of the service; 0 while no process runs."""

    @property
    def restarts(self) -> int:
        """How many times the service was started again."""

    @property
    def stat(self) -> Stat | None:
        """The last answer of the present process to the call `stat` (its status); None before the first answer."""

    @property
    def reason(self) -> str:
        """The reason of the last failure; empty: there was none."""

    @property
    def lets_others_start(self) -> bool:
        """Whether the services that wait for this one may start."""


@dataclass(frozen=True)
class Program:
    """The command of one service process, and the rules for its supervision.

    `who`: name of the service. `argv`: command. `log`: file of its standard output and error. `stage`: number of its group; groups are
    stopped in descending order. `after`: services that must be ready before it joins the system. `nice`: niceness of its process. `vital`:
    whether the robot is stopped if the launcher gives the service up (does not restart it any more). `standby`: whether a second process of
    it may be started in advance, to replace the first one if that fails. `may_end`: whether it may end by itself without a failure.
    `patience`: least time without an answer [s] after which it may count as frozen. `environment`: variables that are added to the
    launcher's own.
    """

    who: str
    argv: tuple[str, ...]
    log: Path
    stage: int = 0
    after: tuple[str, ...] = ()
    nice: int = 0
    vital: bool = True
    standby: bool = False
    may_end: bool = False  # by itself, with code 0
    patience: float = 0.0
    environment: Mapping[str, str] = field(default_factory=dict)


@dataclass
class Child:
    """A service of this host: its program and the process that runs it at present.

    Times are monotonic, in s. `phase`: waiting (for other services), starting, ready, failed (to be restarted), fault (given up) or ended.
    `since`: time of the last change of phase. `failures`: times of recent failures. `again_at`: time of the next start. `has_token`:
    whether the process has its liveliness token on the bus. `asked_at`, `answered_at`: times of the last `stat` call (request for the
    service's status) and of the last answer. `asking`: a call waits for its answer. `unanswered`: number of calls in a row without an
    answer. `stat`: last answer of the present process. `standby`: process that replaces the present process when this one fails.
    `has_prepared`: whether the start of a standby process was tried since the present process was started. `reason`: reason of the last
    failure. `host`: always empty.

    While the service does not answer `stat` calls, it is asked by `pulse` calls how many messages it has handled. `handled`: the last
    answer. `advanced_at`: time at which this number was last seen to grow. `starvation`: measures how long the service and the launcher
    wait for a processor during the silence; None: no silence is recorded.
    """

    program: Program
    phase: Phase = "waiting"
    process: subprocess.Popen[bytes] | None = None
    standby: subprocess.Popen[bytes] | None = None
    has_prepared: bool = False
    since: float = 0.0
    failures: deque[float] = field(default_factory=deque)
    restarts: int = 0
    again_at: float = 0.0
    has_token: bool = False
    asked_at: float = 0.0
    answered_at: float = 0.0
    asking: bool = False
    unanswered: int = 0
    stat: Stat | None = None
    handled: int | None = None
    advanced_at: float = 0.0
    starvation: Starvation | None = None
    reason: str = ""  # of the last failure
    host: str = ""

    @property
    def who(self) -> str:
        """The name of the service."""
        return self.program.who

    @property
    def pid(self) -> int:
        """The process id; 0 while no process runs."""
        return 0 if self.process is None else self.process.pid

    @property
    def lets_others_start(self) -> bool:
        """Whether the services that wait for this one may start: it is ready or has ended, or it has failed and is not vital."""
        return self.phase in ("ready", "ended") or (bool(self.failures) and not self.program.vital)

    def enter(self, phase: Phase) -> None:
        """Change the phase, and store the time of the change."""
        self.phase, self.since = phase, time.monotonic()

    def spawn(self, launcher: str) -> None:
        """Start the process, or use the standby process if there is one.

        The process imports its packages and reads its robot, then waits for `release` before it joins the system. `launcher`: the id of the
        router that the process may join; if this host has joined the system of another host, a blank and the process id of this launcher
        follow. The process gets this text in the environment variable MOBEE_HELD. Raises OSError if the operating system refuses to start
        the process.
        """
        if self.standby is not None and self.standby.poll() is not None:
            self.dismiss()
        self.process, self.standby = self.standby or self._start(launcher), None
        self.has_token, self.asking, self.asked_at, self.stat, self.has_prepared = False, False, 0.0, None, False
        self.note_answer(0.0)

    def prepare(self, launcher: str) -> None:
        """Start a standby process: a second process of the service that can replace the first without the delay of its imports.

        It does not join the system before `spawn` uses it. `launcher`: as for `spawn`. Raises OSError if the operating system refuses to
        start the process.
        """
        self.has_prepared = True
        self.standby = self._start(launcher)

    def _start(self, launcher: str) -> subprocess.Popen[bytes]:
        """Start a process in a process group of its own, so that Ctrl-C in a terminal reaches the launcher only.

        It stays in the launcher's session, because with autogroup scheduling niceness counts only within a session.
        """
        with self.program.log.open("ab") as log:
            process = subprocess.Popen(
                self.program.argv,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                env={**os.environ, **self.program.environment, **_ONE_THREAD, "PYTHONUNBUFFERED": "1", HELD: launcher},
                process_group=0,
            )
        if self.program.nice:
            own = os.getpriority(os.PRIO_PROCESS, 0)  # only root may start a process of a higher priority than its own
            os.setpriority(os.PRIO_PROCESS, process.pid, max(own, self.program.nice))
            if hasattr(os, "SCHED_BATCH"):  # Linux: when it wakes, it preempts no other process
                os.sched_setscheduler(process.pid, os.SCHED_BATCH, os.sched_param(0))
        return process

    def note_answer(self, when: float) -> None:
        """Record that the service answered at the monotonic time `when` [s]; this ends its silence."""
        self.answered_at, self.unanswered, self.handled, self.advanced_at, self.starvation = when, 0, None, 0.0, None

    def note_silence(self, now: float) -> None:
        """Record that the service is silent, and start to measure how long it and the launcher wait for a processor.

        A service is silent from the time at which a `stat` call has waited too long for its answer (0.2 s) until it answers one.
        `silence` subtracts the measured waiting time, so that a service on a busy machine does not count as frozen. The measurement begins
        at the monotonic time `now` [s] and ends at the next answer.
        """
        self.starvation = Starvation((self.pid, os.getpid()), now)

    def note_pulse(self, handled: int, when: float) -> None:
        """Record an answer to the call `pulse`: how many messages the service has handled by the monotonic time `when` [s].

        If the number has grown since the last such answer, the service is slow, not frozen: its silence is measured from `when` on.
        """
        if self.handled is not None and handled > self.handled:
            self.advanced_at = when
            self.note_silence(when)
        self.handled = handled

    def silence(self, now: float) -> float:
        """Return the time [s] since the service last answered or handled a message.

        Time in which it or the launcher waited for a processor does not count. `now`: monotonic time [s].
        """
        return now - max(self.answered_at, self.advanced_at) - (0.0 if self.starvation is None else self.starvation.total)

    def release(self) -> None:
        """Let the service join the system, by a byte on its standard input."""
        assert self.process is not None and self.process.stdin is not None
        with suppress(BrokenPipeError):  # the process has ended; the next check finds this
            self.process.stdin.write(b"\n")
            self.process.stdin.flush()
        with suppress(BrokenPipeError):
            self.process.stdin.close()
        self.enter("starting")

    def exit_code(self) -> int | None:
        """Return the exit code of the process; None while it runs, or if no process was started."""
        return None if self.process is None else self.process.poll()

    def running(self) -> bool:
        """Return whether the process is running."""
        return self.process is not None and self.process.poll() is None

    def terminate(self) -> None:
        """Send SIGTERM to the process, if there is one."""
        if self.process is not None:
            self.process.terminate()

    def kill(self) -> None:
        """Kill the process and all processes of its group, and wait until it has ended."""
        if self.process is not None:
            _kill(self.process)
            self.process = None  # its number may now name another process

    def dismiss(self) -> None:
        """Kill the standby process, if there is one."""
        if self.standby is not None:
            _kill(self.standby)
            self.standby = None

    def last_log_line(self) -> str:
        """Return the last line of the process's log that is not empty, or a text that says why there is none."""
        try:
            with self.program.log.open("rb") as log:
                log.seek(max(0, os.fstat(log.fileno()).st_size - 4000))
                lines = log.read().decode(errors="replace").split("\n")
        except OSError as error:
            return f"its log cannot be read: {error.strerror}"
        return next((line.strip() for line in reversed(lines) if line.strip()), "its log is empty")


def _kill(process: subprocess.Popen[bytes]) -> None:
    try:
        os.killpg(process.pid, signal.SIGKILL)
    except ProcessLookupError:
        pass  # all of them have ended
    process.wait()
    if process.stdin is not None:
        process.stdin.close()
