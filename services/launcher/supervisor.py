# SPDX-License-Identifier: Apache-2.0
"""Starts the services in order, restarts those that fail, and gives up those that fail repeatedly."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Mapping, Sequence

from bus_schema import keys
from bus_schema.rpc import Pulse, Stat
from services.common.exit_codes import BAD_INPUT
from services.common.rpc import CallFailed
from services.common.service import Service
from services.launcher.child import Child, Program, Watched
from services.launcher.stops import EmergencyStops

CHECK_PERIOD = 0.05  # s between two checks of the processes
STAT_PERIOD = 0.5  # s between two stat calls to a service
STAT_TIMEOUT = 1.0  # s within which a service answers
LATE_ANSWER = 0.2  # s after which an answer is late: from then on the time is measured that the processes wait for a processor
MAX_UNANSWERED = 2  # stat calls in a row; then a service can count as frozen
FROZEN_TIME, FROZEN_TIME_NICE = 2.0, 10.0  # s without an answer; the latter for a service that yields to all others
NICE_SERVICE = 10  # niceness from which the longer time applies
READY_TIMEOUT = 60.0  # s from its start until a service is ready
FIRST_WAIT, LONGEST_WAIT = 0.2, 5.0  # s before the second restart and later ones, doubled with every failure; the first is immediate
MAX_RESTARTS, RESTART_WINDOW = 5, 60.0  # restarts within so many s; then a service is given up
STANDBY_DELAY = 10.0  # s for which a service is ready before its standby process starts: many runs end before
STANDBY_PERIOD = 1.0  # s between two starts of standby processes, each of which needs a processor for 0.5 to 1 s
END_TIMEOUT = 2.0  # s from SIGTERM to SIGKILL


class Supervisor:
    """Starts and supervises the child processes of the launcher. All its work is done in the main thread.

    It is done by handlers of `service`, the launcher's connection to the bus.
    `children`: the services of this host, by name. `faults`: one line for each service that was given up (is not restarted any more).
    `stopped_robot`: whether the robot was stopped, because a vital service (`Program.vital`) was given up. `bad_settings`: whether a
    service was given up because it cannot use its settings.
    """

    def __init__(
        self,
        service: Service,
        programs: Sequence[Program],
        stops: EmergencyStops,
        announce: Callable[[str], None],
        held: str = "",
        elsewhere: Mapping[str, Watched] | None = None,
        is_reachable: Callable[[], bool] = lambda: True,
    ) -> None:
        """Prepare the processes; `begin` starts them.

        Args:
            service: the launcher.
            programs: programs of the services that this host starts.
            stops: stops the robot when a vital service is given up.
            announce: called with each line that a user should see.
            held: which router the processes may join, as the argument `launcher` of `Child.spawn`; empty: the router of this launcher.
            elsewhere: services that other hosts start, by name; some services here wait for them.
            is_reachable: returns whether the router can be reached; without it no service can start or answer.
        """
        self.children = {program.who: Child(program) for program in programs}
        self.faults: list[str] = []  # one line for each service that was given up
        self.stopped_robot = False  # a vital service was given up
        self.bad_settings = False  # a service was given up because it cannot use its settings
        self._service, self._announce, self._stopping = service, announce, False
        self._stops, self._held, self._is_reachable = stops, held or service.instance, is_reachable
        self._elsewhere = elsewhere or {}
        self._next_standby = 0.0  # monotonic time [s] from which the next standby process may start
        service.on_alive(self._note_token)

    def begin(self) -> None:
        """Start all processes. A service without dependencies joins the system at once, the others when their dependencies are ready."""
        for child in self.children.values():
            self._spawn(child)
        self._check_all()

    def _spawn(self, child: Child) -> bool:
        """Start a process; if the operating system refuses to start it, it counts as failed, and the launcher continues."""
        try:
            child.spawn(self._held)
        except OSError as error:
            self._fail(child, f"cannot be started: {error}")
            return False
        return True

    def settled(self) -> bool:
        """Return whether every service is ready, has ended by itself, or was given up."""
        return all(child.phase in ("ready", "ended", "fault") for child in self.children.values())

    def has_arrived(self) -> bool:
        """Return whether robot_sim has reached its last tick; always False if no number of ticks is set."""
        sim = self.children.get("robot_sim")
        return sim is not None and sim.stat is not None and (sim.stat.numbers.get("arrived") or 0) > 0

    def stop(self) -> None:
        """End all services, group by group in descending order of `Program.stage`. A service that does not end within 2 s is killed."""
        self._stopping = True
        for child in self.children.values():
            child.dismiss()
        for stage in sorted({child.program.stage for child in self.children.values()}, reverse=True):
            group = [child for child in self.children.values() if child.program.stage == stage]
            for child in group:
                child.terminate()
            self._wait_for(group)
            for child in group:
                if child.running():
                    self._announce(f"{child.who} did not end within {END_TIMEOUT:g} s: killed")
                child.kill()
                child.enter("ended")

    def _wait_for(self, group: Sequence[Child]) -> None:
        self._service.spin(time.monotonic() + END_TIMEOUT, lambda: not any(child.running() for child in group))

    def kill_all(self) -> None:
        """Kill all processes at once."""
        self._stopping = True
        for child in self.children.values():
            child.kill()
            child.dismiss()

    def _check_all(self) -> None:
        now = time.monotonic()
        if not self._stopping:
            for child in self.children.values():
                self._check(child, now)
        self._service.inbox.at(now + CHECK_PERIOD, self._check_all)

    def _check(self, child: Child, now: float) -> None:
        if child.phase == "waiting":
            services: Mapping[str, Watched] = {**self._elsewhere, **self.children}
            if all(services[who].lets_others_start for who in child.program.after if who in services):
                child.release()
        elif child.phase in ("starting", "ready"):
            self._check_process(child, now)
            self._check_standby(child, now)
        if child.phase == "failed" and time.monotonic() >= child.again_at and self._is_reachable():
            child.restarts += 1
            if self._spawn(child):
                child.release()

    def _check_process(self, child: Child, now: float) -> None:
        if child.starvation is not None:
            child.starvation.update(now)
        code = child.exit_code()
        if code is not None:
            self._note_end(child, code)
        elif not self._is_reachable():
            child.note_answer(now)
            child.since = now
        elif child.phase == "starting" and now - child.since > READY_TIMEOUT:
            self._fail(child, f"was not ready within {READY_TIMEOUT:g} s")
        elif child.phase == "ready" and self._is_frozen(child, now):
            self._fail(child, f"is frozen: no answer for {now - child.answered_at:.1f} s, although it had a processor")
        elif child.asking and child.starvation is None and now >= child.asked_at + LATE_ANSWER:
            child.note_silence(now)
            self._ask_pulse(child)
        elif not child.asking and now >= child.asked_at + STAT_PERIOD and (child.has_token or child.phase == "ready"):
            self.ask(child)

    def _check_standby(self, child: Child, now: float) -> None:
        """Start a standby process of a vital service, so that a restart does not wait for the imports; one at a time."""
        is_due = child.phase == "ready" and now - child.since >= STANDBY_DELAY and now >= self._next_standby
        if child.program.standby and is_due and not child.has_prepared:
            self._next_standby = now + STANDBY_PERIOD
            try:
                child.prepare(self._held)
            except OSError as error:
                self._service.log.warning("no standby process of %s: %s", child.who, error)

    def _is_frozen(self, child: Child, now: float) -> bool:
        """Return whether a service is frozen: several calls and a long time without an answer.

        Both are required, because a call on a dropped connection fails at once, and the launcher itself may have been stopped for a while.

        A service that waits for a processor, or that still handles messages, is slow but not frozen.
        """
        limit = max(FROZEN_TIME_NICE if child.program.nice >= NICE_SERVICE else FROZEN_TIME, child.program.patience)
        return child.unanswered >= MAX_UNANSWERED and now - child.answered_at >= limit and child.silence(now) >= limit

    def ask(self, child: Child) -> None:
        """Request the status of a service by a `stat` call; the answer is handled later."""
        pid, child.asking, child.asked_at = child.pid, True, time.monotonic()

        def note(answer: Stat | CallFailed) -> None:
            if child.pid == pid and child.phase in ("starting", "ready"):
                child.asking = False
                self._note_answer(child, answer)

        self._service.ask(keys.service_rpc(child.who, "stat"), Stat, note, timeout=STAT_TIMEOUT, wanted=lambda stat: stat.pid == pid)
        if child.unanswered:
            self._ask_pulse(child)

    def _ask_pulse(self, child: Child) -> None:
        """Ask a service that does not answer `stat` how many messages it has handled: if the number grows, it is slow, not frozen."""
        pid = child.pid

        def note(answer: Pulse | CallFailed) -> None:
            if child.pid == pid and child.starvation is not None and isinstance(answer, Pulse):
                child.note_pulse(answer.handled, time.monotonic())

        self._service.ask(keys.service_rpc(child.who, "pulse"), Pulse, note, timeout=STAT_TIMEOUT)

    def _note_answer(self, child: Child, answer: Stat | CallFailed) -> None:
        if isinstance(answer, CallFailed) or answer.pid != child.pid:
            child.unanswered += 1
            return
        child.note_answer(time.monotonic())
        child.stat = answer
        if child.phase == "starting" and answer.ready:
            says = f": {answer.text}" if answer.text else ""
            self._announce(f"{child.who} is ready after {time.monotonic() - child.since:.1f} s (pid {child.pid}){says}")
            child.enter("ready")

    def _note_token(self, who: str, instance: str, up: bool) -> None:
        child = self.children.get(who)
        if child is None:
            return
        if instance.startswith(f"i{child.pid}_"):
            child.has_token = up
        elif up:
            own = f"process {child.pid} of this launcher" if child.pid else "no process of this launcher at present"
            self._service.bus.reject("two_processes", f"a second {who}, {instance}, is on the bus beside {own}")

    def _note_end(self, child: Child, code: int) -> None:
        if code == 0 and child.program.may_end:
            self._announce(f"{child.who} has ended")
            child.kill()
            child.dismiss()
            child.enter("ended")
        elif code == BAD_INPUT:
            child.kill()
            self.bad_settings = True
            self._give_up(child, f"cannot use its settings: {child.last_log_line()}")
        elif code < 0:
            self._fail(child, f"was killed by {_name(-code)}")
        elif code == 0:
            self._fail(child, "ended, and the launcher had not asked for it")
        else:
            self._fail(child, f"ended with code {code}: {child.last_log_line()}")

    def _fail(self, child: Child, reason: str) -> None:
        """Kill the process, and start it again: at once after the first failure, later after a time that doubles with every failure."""
        child.kill()
        now = time.monotonic()
        child.failures.append(now)
        while now - child.failures[0] > RESTART_WINDOW:
            child.failures.popleft()
        child.reason = reason
        if len(child.failures) > MAX_RESTARTS:
            self._give_up(child, f"{reason}; given up after {MAX_RESTARTS} restarts in {RESTART_WINDOW:g} s")
            return
        wait = 0.0 if len(child.failures) == 1 else min(FIRST_WAIT * 2 ** (len(child.failures) - 2), LONGEST_WAIT)
        child.again_at = now + wait
        child.enter("failed")
        self._service.bus.event("warning", "restart", f"{child.who} {reason}")
        self._announce(f"{child.who} {reason}; starts again {f'in {wait:.1f} s' if wait else 'at once'}")

    def _give_up(self, child: Child, reason: str) -> None:
        child.reason = reason
        child.dismiss()
        child.enter("fault")
        self.report_fault(f"{child.who} {reason}", child.program.vital, f" (its log: {child.program.log})")

    def report_fault(self, fault: str, vital: bool, more: str = "") -> None:
        """Publish an event and show on the screen that a service was given up, that is, that it is not restarted any more.

        `fault`: service and reason. `vital`: True: also stop the robot. `more`: text that is added on the screen only.
        """
        self.faults.append(fault)
        self._service.bus.event("error", "fault", fault)
        self._announce(f"FAULT: {fault}{more}")
        if vital:
            self._stop_robot(fault)

    def _stop_robot(self, reason: str) -> None:
        self.stopped_robot = True
        self._stops.stop(reason)
        self._announce("the whole robot is stopped; `mobee estop --reset` releases it")


def _name(number: int) -> str:
    """Return the name of a signal; a real-time signal has none."""
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"
