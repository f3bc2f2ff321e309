# SPDX-License-Identifier: Apache-2.0
"""A service as a child process: starts it, watches it, ends it."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections import deque
from collections.abc import Mapping
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
    """What a launcher reports of a service that runs on this host or on another one."""

    @property
    def who(self) -> str:
        """The service's name."""

    @property
    def host(self) -> str:
        """The host that has started it; empty: this one, or not known."""

    @property
    def phase(self) -> Phase:
        """The phase."""

    @property
    def pid(self) -> int:
        """The process id on its host; 0 while no process runs."""

    @property
    def restarts(self) -> int:
        """How often it was started again."""

    @property
    def stat(self) -> Stat | None:
        """The last answer of the present process."""

    @property
    def reason(self) -> str:
        """Why it failed last."""

    @property
    def lets_others_start(self) -> bool:
        """Whether services that come after it may start."""


@dataclass(frozen=True)
class Program:
    """The command and settings of one service process."""

    who: str
    argv: tuple[str, ...]
    log: Path  # standard output and error
    stage: int = 0
    after: tuple[str, ...] = ()
    nice: int = 0
    vital: bool = True
    may_end: bool = False  # by itself, with code 0
    patience: float = 0.0  # least time [s] without an answer after which it counts as frozen
    environment: Mapping[str, str] = field(default_factory=dict)  # added to the launcher's own


@dataclass
class Child:
    """A program and the process that runs it at present."""

    program: Program
    phase: Phase = "waiting"
    process: subprocess.Popen[bytes] | None = None
    since: float = 0.0  # monotonic time of the last change of phase
    failures: deque[float] = field(default_factory=deque)  # monotonic times
    restarts: int = 0
    again_at: float = 0.0  # monotonic time of the next start
    has_token: bool = False
    asked_at: float = 0.0
    answered_at: float = 0.0  # monotonic, as asked_at
    asking: bool = False
    unanswered: int = 0  # stat calls in a row
    stat: Stat | None = None  # last answer of the present process
    handled: int | None = None  # by its inbox, at the last pulse of the present silence
    advanced_at: float = 0.0  # monotonic time at which the inbox was last seen to advance
    starvation: Starvation | None = None  # of it and the launcher, in the present silence
    reason: str = ""  # of the last failure
    host: str = ""

    @property
    def who(self) -> str:
        """The service's name."""
        return self.program.who

    @property
    def pid(self) -> int:
        """The process id; 0 while no process runs."""
        return 0 if self.process is None else self.process.pid

    @property
    def lets_others_start(self) -> bool:
        """Whether services that come after it may start: it is ready, or is not needed and has failed."""
        return self.phase in ("ready", "ended") or (bool(self.failures) and not self.program.vital)

    def enter(self, phase: Phase) -> None:
        """Change the phase."""
        self.phase, self.since = phase, time.monotonic()

    def spawn(self, launcher: str) -> None:
        """Start the process, in its own group, so that Ctrl-C in a terminal reaches the launcher only; `launcher`: the words of HELD.

        It stays in the same session, because with autogroup scheduling niceness counts only within one.  The service imports its
        packages, reads its robot, and then waits for `release` before it joins the system.
        """
        with self.program.log.open("ab") as log:
            self.process = subprocess.Popen(
                self.program.argv,
                stdin=subprocess.PIPE,
                stdout=log,
                stderr=log,
                env={**os.environ, **self.program.environment, **_ONE_THREAD, "PYTHONUNBUFFERED": "1", HELD: launcher},
                process_group=0,
            )
        if self.program.nice:
            own = os.getpriority(os.PRIO_PROCESS, 0)  # only root may start a process of a higher priority than its own
            os.setpriority(os.PRIO_PROCESS, self.process.pid, max(own, self.program.nice))
            if hasattr(os, "SCHED_BATCH"):  # Linux: when it wakes, it preempts no other process
                os.sched_setscheduler(self.process.pid, os.SCHED_BATCH, os.sched_param(0))
        self.has_token, self.asking, self.asked_at, self.stat = False, False, 0.0, None
        self.note_answer(0.0)

    def note_answer(self, when: float) -> None:
        """Note that it answered, which ends its silence."""
        self.answered_at, self.unanswered, self.handled, self.advanced_at, self.starvation = when, 0, None, 0.0, None

    def note_silence(self, now: float) -> None:
        """Measure from now on how long it or the launcher has no processor, until it answers."""
        self.starvation = Starvation((self.pid, os.getpid()), now)

    def note_pulse(self, handled: int, when: float) -> None:
        """Note how many messages it has handled: more than at the last pulse of this silence means that it is alive."""
        if self.handled is not None and handled > self.handled:
            self.advanced_at = when
            self.note_silence(when)
        self.handled = handled

    def silence(self, now: float) -> float:
        """Return the time [s] since it last answered or its inbox advanced, without the time that it or the launcher had no processor."""
        return now - max(self.answered_at, self.advanced_at) - (0.0 if self.starvation is None else self.starvation.total)

    def release(self) -> None:
        """Let the service join the system."""
        assert self.process is not None and self.process.stdin is not None
        self.process.stdin.close()
        self.enter("starting")

    def exit_code(self) -> int | None:
        """Return the code with which the process ended; None while it runs."""
        return None if self.process is None else self.process.poll()

    def running(self) -> bool:
        """Return whether the process is running."""
        return self.process is not None and self.process.poll() is None

    def terminate(self) -> None:
        """Send SIGTERM to the process, if it runs."""
        if self.process is not None:
            self.process.terminate()

    def kill(self) -> None:
        """Kill the process and its children, and wait until it has ended."""
        if self.process is None:
            return
        try:
            os.killpg(self.process.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass  # all of them have ended
        self.process.wait()
        if self.process.stdin is not None:
            self.process.stdin.close()
        self.process = None  # its number may now name another process

    def last_log_line(self) -> str:
        """Return the last line of the log of the process."""
        try:
            with self.program.log.open("rb") as log:
                log.seek(max(0, os.fstat(log.fileno()).st_size - 4000))
                lines = log.read().decode(errors="replace").split("\n")
        except OSError as error:
            return f"its log cannot be read: {error.strerror}"
        return next((line.strip() for line in reversed(lines) if line.strip()), "its log is empty")
