"""Starts services in order, restarts failed ones, and gives up those that fail repeatedly."""

from __future__ import annotations

import signal
import time
from collections.abc import Callable, Sequence

from bus_schema import keys
from bus_schema.messages import EStop
from bus_schema.rpc import Stat
from services.common.exit_codes import BAD_INPUT
from services.common.rpc import CallFailed
from services.common.service import Service
from services.launcher.child import Child, Program

LOOK = 0.05  # s between looks at the processes
POLL = 0.5  # s between questions
ANSWER = 1.0  # s within which a service answers
UNANSWERED = 2  # questions in a row, then it counts as frozen
FROZEN, FROZEN_LATE = 2.0, 10.0  # s without an answer; the latter for what yields to all others, and so is slow where they are busy
PICTURES = 10  # niceness from which that is so
READY = 60.0  # s from its start until a service is ready
FIRST_WAIT, LONGEST_WAIT = 0.2, 5.0  # s before a restart: doubled with every failure
RESTARTS, WINDOW = 5, 60.0  # so many in so many s, then it is given up
END = 2.0  # s from SIGTERM to SIGKILL


class Supervisor:
    """The children of the launcher; everything happens in the inbox of its service."""

    def __init__(self, service: Service, programs: Sequence[Program], tell: Callable[[str], None]) -> None:
        self.children = {program.who: Child(program) for program in programs}
        self.faults: list[str] = []  # one line each
        self.stopped_robot = False  # a vital service was given up
        self.bad_settings = False  # a service was given up since it cannot use them
        self._service, self._tell, self._stopping = service, tell, False
        self._estop = service.bus.publisher(EStop)
        service.on_alive(self._note_token)

    def begin(self) -> None:
        """Start all; what waits for nobody joins at once, the rest follows while the service spins."""
        for child in self.children.values():
            child.spawn()
        self._look()

    def settled(self) -> bool:
        """Whether every service is ready, has done its work, or was given up."""
        return all(child.phase in ("ready", "ended", "fault") for child in self.children.values())

    def has_arrived(self) -> bool:
        """Whether robot_sim has made the ticks it was asked for."""
        sim = self.children.get("robot_sim")
        return sim is not None and sim.stat is not None and sim.stat.numbers.get("arrived", 0.0) > 0.0

    def stop(self) -> None:
        """End all services, the last started first."""
        self._stopping = True
        for stage in sorted({child.program.stage for child in self.children.values()}, reverse=True):
            group = [child for child in self.children.values() if child.program.stage == stage]
            for child in group:
                child.terminate()
            self._wait_for(group)
            for child in group:
                if child.running():
                    self._tell(f"{child.who} did not end within {END:g} s: killed")
                child.kill()
                child.enter("ended")

    def _wait_for(self, group: Sequence[Child]) -> None:
        self._service.spin(time.monotonic() + END, lambda: not any(child.running() for child in group))

    def kill_all(self) -> None:
        """Leave no process behind."""
        self._stopping = True
        for child in self.children.values():
            child.kill()

    def _look(self) -> None:
        now = time.monotonic()
        if not self._stopping:
            for child in self.children.values():
                self._look_at(child, now)
        self._service.inbox.at(now + LOOK, self._look)

    def _look_at(self, child: Child, now: float) -> None:
        if child.phase == "waiting":
            before = (self.children[who] for who in child.program.after if who in self.children)
            if all(other.phase in ("ready", "ended") for other in before):
                child.release()
        elif child.phase == "failed" and now >= child.again_at:
            child.restarts += 1
            child.spawn()
            child.release()
        elif child.phase in ("starting", "ready"):
            self._look_at_process(child, now)

    def _look_at_process(self, child: Child, now: float) -> None:
        code = child.exit_code()
        if code is not None:
            self._note_end(child, code)
        elif child.phase == "starting" and now - child.since > READY:
            self._fail(child, f"was not ready within {READY:g} s")
        elif child.phase == "ready" and self._is_frozen(child, now):
            self._fail(child, f"is frozen: no answer for {now - child.answered_at:.1f} s")
        elif not child.asking and now >= child.asked_at + POLL and (child.has_token or child.phase == "ready"):
            self.ask(child)

    def _is_frozen(self, child: Child, now: float) -> bool:
        """Both, since a call to a process whose connection was dropped fails at once, and the launcher itself may have been stopped."""
        limit = max(FROZEN_LATE if child.program.nice >= PICTURES else FROZEN, child.program.patience)
        return child.unanswered >= UNANSWERED and now - child.answered_at >= limit

    def ask(self, child: Child) -> None:
        """Have its numbers brought up to date."""
        pid, child.asking, child.asked_at = child.pid, True, time.monotonic()

        def note(answer: Stat | CallFailed) -> None:
            if child.pid == pid and child.phase in ("starting", "ready"):
                child.asking = False
                self._note_answer(child, answer)

        self._service.ask(keys.service_rpc(child.who, "stat"), Stat, note, timeout=ANSWER)

    def _note_answer(self, child: Child, answer: Stat | CallFailed) -> None:
        if isinstance(answer, CallFailed) or answer.pid != child.pid:
            child.unanswered += 1
            return
        child.unanswered, child.answered_at, child.stat = 0, time.monotonic(), answer
        if child.phase == "starting" and answer.ready:
            says = f": {answer.text}" if answer.text else ""
            self._tell(f"{child.who} is ready after {time.monotonic() - child.since:.1f} s (pid {child.pid}){says}")
            child.enter("ready")
            if child.who == "robot_sim" and self.stopped_robot:
                self._stop_robot("a vital service was given up before")  # the new process does not know

    def _note_token(self, who: str, instance: str, up: bool) -> None:
        child = self.children.get(who)
        if child is not None and instance.startswith(f"i{child.pid}_"):
            child.has_token = up

    def _note_end(self, child: Child, code: int) -> None:
        if code == 0:
            self._tell(f"{child.who} has ended")
            child.kill()
            child.enter("ended")
        elif code == BAD_INPUT:
            child.kill()
            self.bad_settings = True
            self._give_up(child, f"cannot use its settings: {child.last_words()}")
        elif code < 0:
            self._fail(child, f"was killed by {signal.Signals(-code).name}")
        else:
            self._fail(child, f"ended with code {code}: {child.last_words()}")

    def _fail(self, child: Child, reason: str) -> None:
        """Kill it, and start it again after a while that doubles with every failure."""
        child.kill()
        now = time.monotonic()
        child.failures.append(now)
        while now - child.failures[0] > WINDOW:
            child.failures.popleft()
        child.reason = reason
        if len(child.failures) > RESTARTS:
            self._give_up(child, f"{reason}; given up after {RESTARTS} restarts in {WINDOW:g} s")
            return
        wait = min(FIRST_WAIT * 2 ** (len(child.failures) - 1), LONGEST_WAIT)
        child.again_at = now + wait
        child.enter("failed")
        self._service.bus.event("warning", "restart", f"{child.who} {reason}")
        self._tell(f"{child.who} {reason}; starts again in {wait:.1f} s")

    def _give_up(self, child: Child, reason: str) -> None:
        child.reason = reason
        child.enter("fault")
        self.faults.append(f"{child.who} {reason}")
        self._service.bus.event("error", "fault", self.faults[-1])
        self._tell(f"FAULT: {self.faults[-1]} (its log: {child.program.log})")
        if child.program.vital:
            self._stop_robot(self.faults[-1])

    def _stop_robot(self, reason: str) -> None:
        self.stopped_robot = True
        self._estop.put(set=True, source="launcher", reason=reason[:2000])
        self._tell("the whole robot is stopped; `mobee estop --reset` releases it")
