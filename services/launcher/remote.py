# SPDX-License-Identifier: Apache-2.0
"""Observes services that another host runs: whether they are present and answer. It starts and kills no process."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bus_schema import keys
from bus_schema.authority import HOST_LAUNCHER
from bus_schema.rpc import Done, Stat
from services.common.rpc import CallFailed
from services.common.service import Service
from services.launcher.child import Phase
from services.launcher.supervisor import MAX_UNANSWERED, STAT_PERIOD, STAT_TIMEOUT

CHECK_PERIOD = 0.1  # s between two checks
SILENT_TIME = 10.0  # s without an answer after which a service counts as absent, although its token is there
ABSENT_TIME = 60.0  # s without a service that was ready before, after which it is given up
LEAVE_TIMEOUT = 8.0  # s within which the launchers of other hosts end their services
SERVICES = "services"  # word in the status of the launcher of another host: the services that it runs, with blanks between


@dataclass
class Remote:
    """State of a service that another host runs, as this launcher observes it over the bus.

    The launcher sees the service's liveliness token (a key on the bus that exists as long as the process runs), and asks for its status by
    `stat` calls.

    Times are monotonic, in s. `who`: name. `vital`: whether the robot is stopped if the service is given up. `phase`: waiting (not yet
    present), starting, ready, failed (absent or silent) or fault (given up). `since`: time of the last change of phase. `absent_since`:
    time since when it has not been ready; None: it is ready now, or never was. `host`: name of the host that runs it; empty: not known.
    `instance`: id of the present process; empty: there is none. `known`: id of the last process, kept when it is gone. `restarts`: number
    of changes to another process. `asking`: a `stat` call waits for its answer. `asked_at`, `answered_at`: times of the last `stat` call
    and the last answer. `unanswered`: number of calls in a row without an answer. `stat`: last answer. `reason`: reason of the last
    failure.
    """

    who: str
    vital: bool = True
    phase: Phase = "waiting"
    since: float = 0.0
    absent_since: float | None = None
    host: str = ""
    instance: str = ""
    known: str = ""
    restarts: int = 0
    asking: bool = False
    asked_at: float = 0.0
    answered_at: float = 0.0
    unanswered: int = 0
    stat: Stat | None = None
    reason: str = ""

    @property
    def pid(self) -> int:
        """The process id on the other host; 0 if it is not known."""
        return 0 if self.stat is None else self.stat.pid

    @property
    def lets_others_start(self) -> bool:
        """Whether the services that wait for this one may start: it is ready, or it is not vital and has been on the bus at least once."""
        return self.phase == "ready" or (bool(self.known) and not self.vital)

    def enter(self, phase: Phase) -> None:
        """Change the phase, and store the time of the change."""
        now = time.monotonic()
        if phase == "ready":
            self.absent_since = None
        elif self.phase == "ready":
            self.absent_since = now
        self.phase, self.since = phase, now


class Remotes:
    """Observes all services of other hosts by their liveliness tokens and their answers to `stat` calls.

    `services`: the state of each service, by name. All checks run in the main thread, as callbacks of the launcher's bus (`Service`).
    """

    def __init__(
        self,
        service: Service,
        vital: Mapping[str, bool],
        announce: Callable[[str], None] = lambda text: None,
        give_up: Callable[[Remote], None] | None = None,
    ) -> None:
        """Prepare to observe the services; `begin` starts the checks.

        Args:
            service: the launcher.
            vital: for each service of other hosts, by name, whether the robot depends on it.
            announce: called with each line that a user should see.
            give_up: called when a service that was ready has been absent for ABSENT_TIME (60 s); None: the launcher of the first host
                decides.
        """
        self.services = {who: Remote(who, is_vital) for who, is_vital in vital.items()}
        self._service, self._announce, self._give_up = service, announce, give_up
        self._launchers: dict[str, str] = {}  # of other hosts, with their instances
        service.on_alive(self._note_token)

    def begin(self) -> None:
        """Start to check all services every 0.1 s."""
        self._check_all()

    def end_hosts(self) -> None:
        """Ask the launchers of all other hosts to end, and wait until they have left, for at most 8 s."""
        for launcher in self._launchers:
            self._service.ask(keys.service_rpc(launcher, "shutdown"), Done, lambda answer: None, timeout=STAT_TIMEOUT)
        self._service.spin(time.monotonic() + LEAVE_TIMEOUT, lambda: not self._launchers)

    def ask(self, remote: Remote) -> None:
        """Request the status of a service by a `stat` call; the answer is handled later."""
        instance, remote.asking, remote.asked_at = remote.instance, True, time.monotonic()

        def note(answer: Stat | CallFailed) -> None:
            if remote.instance == instance:
                remote.asking = False
                self._note_answer(remote, answer)

        call = keys.service_rpc(remote.who, "stat")
        self._service.ask(call, Stat, note, timeout=STAT_TIMEOUT, wanted=lambda stat: stat.instance == instance)

    def _note_token(self, who: str, instance: str, up: bool) -> None:
        if who.startswith(HOST_LAUNCHER):
            self._note_launcher(who, instance, up)
        remote = self.services.get(who)
        if remote is None:
            return
        if up and remote.instance in ("", instance):
            self._begin_process(remote, instance)
        elif up:
            self._service.bus.reject("two_processes", f"a second {who}, {instance}, is on the bus beside {remote.instance} of another host")
        elif instance == remote.instance:
            others = self._service.alive.get(who, set()) - {instance}
            self._lose(remote, "is gone")
            if others:
                self._begin_process(remote, min(others))

    def _begin_process(self, remote: Remote, instance: str) -> None:
        remote.restarts += remote.known not in ("", instance)  # after a cut of the network the same process comes back
        remote.instance = remote.known = instance
        remote.asking, remote.asked_at, remote.stat = False, 0.0, None
        remote.enter("starting")

    def _lose(self, remote: Remote, reason: str) -> None:
        """Note that a service is absent; `reason` begins with a verb."""
        if reason == "is gone":
            remote.instance = ""
        remote.reason = f"{reason}{_on(remote)}"
        remote.enter("failed")
        self._service.bus.event("warning", "absent", f"{remote.who} {remote.reason}")
        self._announce(f"{remote.who} {remote.reason}")

    def _check_all(self) -> None:
        now = time.monotonic()
        for remote in self.services.values():
            self._check(remote, now)
        self._service.inbox.at(now + CHECK_PERIOD, self._check_all)

    def _check(self, remote: Remote, now: float) -> None:
        if remote.instance and not remote.asking and now >= remote.asked_at + STAT_PERIOD:
            self.ask(remote)
        silent = remote.unanswered >= MAX_UNANSWERED and now - remote.answered_at >= SILENT_TIME
        if remote.phase == "ready" and silent:
            self._lose(remote, "does not answer")
        gone = remote.absent_since is not None and now - remote.absent_since >= ABSENT_TIME
        if self._give_up is not None and remote.phase in ("starting", "failed") and gone:
            remote.reason = f"has been absent for {ABSENT_TIME:g} s{_on(remote)}"
            remote.enter("fault")
            self._give_up(remote)

    def _note_answer(self, remote: Remote, answer: Stat | CallFailed) -> None:
        if isinstance(answer, CallFailed) or answer.instance != remote.instance:
            remote.unanswered += 1
            return
        remote.answered_at, remote.unanswered, remote.stat = time.monotonic(), 0, answer
        if answer.ready and remote.phase != "ready":
            says = f": {answer.text}" if answer.text else ""
            self._announce(f"{remote.who} is ready{_on(remote)} (process {answer.pid}){says}")
            remote.enter("ready")

    def _note_launcher(self, launcher: str, instance: str, up: bool) -> None:
        host = launcher.removeprefix(HOST_LAUNCHER)
        if up and self._launchers.get(launcher, instance) == instance:
            self._launchers[launcher] = instance
            self._announce(f"host {host} has joined")
            self._ask_services(launcher, instance)
        elif up:
            self._service.bus.reject("two_processes", f"a second launcher of a host {host}, {instance}, is on the bus")
        elif self._launchers.get(launcher) == instance:
            del self._launchers[launcher]
            self._announce(f"host {host} has left, or is not reachable")

    def _ask_services(self, launcher: str, instance: str) -> None:
        """Ask the launcher of another host which services it runs, until it answers."""
        if self._launchers.get(launcher) != instance:
            return

        def note(answer: Stat | CallFailed) -> None:
            if isinstance(answer, CallFailed):
                self._service.inbox.at(time.monotonic() + STAT_PERIOD, lambda: self._ask_services(launcher, instance))
                return
            for who in answer.words.get(SERVICES, "").split():
                if who in self.services:
                    self.services[who].host = launcher.removeprefix(HOST_LAUNCHER)

        call = keys.service_rpc(launcher, "stat")
        self._service.ask(call, Stat, note, timeout=STAT_TIMEOUT, wanted=lambda stat: stat.instance == instance)


def _on(remote: Remote) -> str:
    return f" (host {remote.host})" if remote.host else ""
