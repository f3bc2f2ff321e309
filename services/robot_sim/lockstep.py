# SPDX-License-Identifier: Apache-2.0
"""Lockstep in robot_sim: every tick waits for the answers of the participating services; events that break repeatability are counted."""

from __future__ import annotations

import time
from collections.abc import Mapping

from services.common.lockstep import Barrier
from services.common.service import Service
from services.robot_sim.guard import Guard

EVENT_PERIOD = 1.0  # s between two events about flaws
START_PERIOD = 0.05  # s between two repetitions of tick 0


class Lockstep:
    """Lockstep in robot_sim: waits in every tick for the answers of all participants, and counts flaws.

    `flaws`: number of events that made the run unrepeatable.
    """

    def __init__(self, service: Service, participants: tuple[str, ...], guard: Guard, last_tick: int) -> None:
        """`participants`: services that must be present before tick 1. `last_tick`: tick at which the run ends; 0: it does not end."""
        self._service, self._guard = service, guard
        self._barrier = Barrier(service, participants, self._note, patience=service.config.patience)
        guard.on_answer(self._barrier.note)
        self._last_tick = last_tick
        self.flaws = 0
        self._reported = -EVENT_PERIOD  # monotonic clock
        self._began = self._answered = 0.0  # monotonic clock: tick 1, the last tick

    def begin(self) -> None:
        """Begin a new run: no participant has answered yet, and the count of flaws (events that made the run unrepeatable) is 0."""
        self._barrier.begin()
        self.flaws, self._reported = 0, -EVENT_PERIOD

    def is_complete(self) -> bool:
        """Return whether all participants have answered tick 0, which is repeated until then."""
        self._began = time.monotonic()
        return not self._barrier.absent()

    def startup_status(self) -> str:
        """Return a text for `mobee status`: the participants (services that must answer every tick) that have not answered tick 0 yet."""
        absent = self._barrier.absent()
        return f"waits for {', '.join(absent)}" if absent else "all participants are ready"

    def wait(self, k: int) -> None:
        """Wait for the answers of the present participants to tick k, then give the waiting commands to the safety gates.

        A safety gate is the last check of a part's commands. The order of the commands does not depend on their arrival. If a participant
        does not answer in time, the parts that it owns are put in hold (they brake and stand still); if it is the model, all parts are put
        in hold.
        """
        for who in self._barrier.wait(k):
            self._guard.hold_dependents(who)
        self._guard.admit_waiting()
        self._answered = time.monotonic()

    def is_over(self) -> bool:
        """Return whether the run has reached its last tick."""
        return self._service.bus.k == self._last_tick > 0

    def is_degraded(self) -> bool:
        """Return whether an expected participant is absent, or nobody takes part; ticks then run in real time."""
        return bool(self._barrier.absent()) or self._barrier.is_empty()

    def note_flaw(self, why: str) -> None:
        """Count an event that makes the run unrepeatable, and report it at most once per second; `why`: text for the report."""
        self.flaws += 1
        now = time.monotonic()
        if now - self._reported >= EVENT_PERIOD:
            self._reported = now
            self._service.bus.event("warning", "not_repeatable", f"this run is not repeatable: {why}", k=float(self._service.bus.k))

    def speed(self, dt: float) -> float:
        """Return the average number of simulated seconds per second of real time since tick 1; `dt`: the tick, s."""
        return self._service.bus.k * dt / max(self._answered - self._began, 1e-9)

    def numbers(self) -> Mapping[str, float]:
        """Return the numbers of the run, by name, for the call `stat`.

        "tick": number of the present tick. "flaws": number of events that made the run unrepeatable. "arrived": True if the last tick is
        reached.
        """
        return {"tick": self._service.bus.k, "flaws": self.flaws, "arrived": self.is_over()}

    def _note(self, who: str, why: str) -> None:
        if self._service.bus.k > 0 and not self.is_over():  # tick 0 is repeated until all are present
            self.note_flaw(f"{who} {why}")
