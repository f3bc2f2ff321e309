"""Lockstep in robot_sim: owns the ticks, collects participants, waits for them, records whether the run is reproducible."""

from __future__ import annotations

import time
from collections.abc import Mapping

from services.common.lockstep import Barrier
from services.common.service import Service
from services.robot_sim.guard import Guard

TELLS = 1.0  # s between two events about flaws
GATHERING = 0.05  # s between two calls to come


class Lockstep:
    """The barrier of a run, and what was wrong with it."""

    def __init__(self, service: Service, participants: tuple[str, ...], guard: Guard, last_tick: int) -> None:
        """`last_tick`: where the run ends, 0: nowhere."""
        self._service, self._guard = service, guard
        self._barrier = Barrier(service, participants, self._note, patience=service.config.patience)
        guard.answered = lambda commands, answer: self._barrier.note(commands.src, commands.re_k, answer)
        self._last_tick = last_tick
        self.flaws = 0
        self._told = -TELLS  # monotonic clock
        self._began = self._answered = 0.0  # monotonic clock: tick 1, the last tick

    def begin(self) -> None:
        """A new run."""
        self._barrier.begin()
        self.flaws, self._told = 0, -TELLS

    def is_complete(self) -> bool:
        """Whether everybody has answered tick 0; until then it is repeated."""
        self._began = time.monotonic()
        return not self._barrier.absent()

    def startup_status(self) -> str:
        """What tick 0 waits for, in words."""
        absent = self._barrier.absent()
        return f"waits for {', '.join(absent)}" if absent else "about to begin"

    def wait(self, k: int) -> None:
        """Until tick k is answered; then its commands are admitted, whatever the order in which they came.

        What depends on somebody who is late holds, and while anybody is away the ticks keep to the clock on the wall.
        """
        for who in self._barrier.wait(k):
            self._guard.do_without(who)
        self._guard.obey()
        self._answered = time.monotonic()

    def is_over(self) -> bool:
        """Whether the run has made its ticks."""
        return self._service.bus.k == self._last_tick > 0

    def is_degraded(self) -> bool:
        """Whether it goes on without somebody who should be there."""
        return bool(self._barrier.absent())

    def spoil(self, why: str) -> None:
        """Something happened that will not happen again at the same tick: counted, and told at most once a second."""
        self.flaws += 1
        now = time.monotonic()
        if now - self._told >= TELLS:
            self._told = now
            self._service.bus.event("warning", "not_repeatable", f"this run cannot be repeated: {why}", k=float(self._service.bus.k))

    def speed(self, dt: float) -> float:
        """Simulated seconds a second since tick 1."""
        return self._service.bus.k * dt / max(self._answered - self._began, 1e-9)

    def numbers(self) -> Mapping[str, float]:
        """For `stat`."""
        return {"tick": self._service.bus.k, "flaws": self.flaws, "arrived": self.is_over()}

    def _note(self, who: str, why: str) -> None:
        if self._service.bus.k > 0 and not self.is_over():  # before tick 1 it will be waited for
            self.spoil(f"{who} {why}")
