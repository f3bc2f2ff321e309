"""Publishes the controller's commands, motions and counters; in lockstep also its answer to the tick."""

from __future__ import annotations

import time
from collections.abc import Mapping

from bus_schema.messages import Answer, Commands, Forces, Motion, Order, Tick
from mobee import Controller
from mobee.arrays import Array
from mobee.robot.robot import Robot
from services.common.bus import Bus
from services.common.lockstep import Participant
from services.common.rate import Percentiles
from services.common.service import Service
from services.controller.action import Action, Owner, busy_owners
from services.controller.drives import Drives


class Counters:
    """One instance a measurement."""

    def __init__(self) -> None:
        self.ticks = self.late_forces = self.held_ticks = self.long_gaps = 0
        self._stepped_at = 0.0  # s, monotonic clock
        self._jitter = Percentiles()  # ms, of the time between two steps

    def watch_period(self, due: float) -> None:
        """Once a step: how far from due [s] after the one before it comes."""
        before, self._stepped_at = self._stepped_at, time.monotonic()
        if before > 0.0:
            self._jitter.add(abs(self._stepped_at - before - due) * 1e3)

    def numbers(self) -> Mapping[str, float]:
        """For `stat`."""
        return {
            "ticks": self.ticks,
            "late_forces": self.late_forces,
            "held_ticks": self.held_ticks,
            "long_gaps": self.long_gaps,
            "jitter_ms_p50": self._jitter.at(50),
            "jitter_ms_p99": self._jitter.at(99),
        }


SOMETIMES = 50  # ticks: so often a part under way, or one that nobody owns, tells of its motion in lockstep
NEWS = 0.01  # s of real time: so often every part tells of its motion in free mode, and of a change at once


class Telling:
    """The motion streams."""

    def __init__(self, bus: Bus, robot: Robot, law: Controller, actions: Mapping[str, Action]) -> None:
        self._law, self._actions = law, actions
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._streams = {part: bus.publisher(Motion, part) for part in robot.parts}
        self._told: dict[str, tuple[str, Owner | None]] = {}  # of each part's last message

    def tell(self, tick: Tick, q: Array, forces: Forces | None) -> None:
        """Where the actions stand, of those of which that is not known; q (n,) rad measured."""
        parts = [part for part in self._actions if not self._is_redundant(part, tick)]
        if not parts:
            return
        touched = forces.touched if forces is not None else {}
        velocity, acceleration, attractor = self._law.velocity, self._law.acceleration, self._law.attractor
        for part in parts:
            action, where = self._actions[part], self._where[part]
            self._streams[part].put(
                k=tick.k,
                t=tick.t,
                action_id=action.id,
                epoch=action.owner.epoch if action.owner is not None else 0,
                status=action.status,
                since_k=action.since_k,
                start_k=action.start_k,
                q=q[where].tolist(),
                dq=velocity[where].tolist(),
                ddq=acceleration[where].tolist(),
                goal=attractor[where].tolist(),
                touched=touched.get(part, []),
            )

    def _is_redundant(self, part: str, tick: Tick) -> bool:
        """Whether nobody waits for news of the part, since it is under way as it was, or nobody's, or in free mode goes on in any way."""
        action, k = self._actions[part], tick.k
        known, self._told[part] = self._told.get(part), (action.id, action.owner)
        if known != self._told[part] or action.since_k >= k:
            return False
        if tick.mode == "lock":
            return (action.status == "moving" or action.owner is None) and k % SOMETIMES > 0
        return k % max(1, round(1e9 * NEWS * tick.rate / tick.dt)) > 0


class Commanding:
    """One message a tick to all parts that obey."""

    def __init__(self, service: Service, ttl: int, actions: Mapping[str, Action], drives: Drives) -> None:
        self._ttl, self._actions, self._drives = ttl, actions, drives
        self._commands = service.bus.publisher(Commands)
        self._participant = Participant(service)
        self._to_answer: tuple[int, Answer] | None = None  # lockstep: a tick, and what will be said to it
        drives.answered = self._answer

    def forget(self) -> None:
        """A new tick, or a new run: what was not answered yet never will be."""
        self._to_answer = None

    def command(self, k: int, orders: dict[str, Order], reference: Array, answer: Answer | None = None) -> None:
        """Tick k's orders, if there are any; reference (n,) of the modality."""
        if orders:
            self._commands.put(re_k=k, parts=orders, ref=reference.tolist(), ttl=self._ttl, answer=answer)

    def close(self, tick: Tick, forces: Forces | None, fresh: bool, orders: dict[str, Order], reference: Array) -> None:
        """Lockstep: command, and answer the tick in the same message unless a part is being armed; tick 0 when all has begun."""
        if tick.k == 0 and not (fresh and self._has_begun(tick)):
            return
        including = [forces.src] if forces is not None and forces.re_k == tick.k else []
        answer = Answer(fresh, busy_owners(self._actions.values()), including)
        self._to_answer = tick.k, answer
        if tick.k == 0 or not orders or self._drives.asking:
            self.command(tick.k, orders, reference)
            self._answer()
            return
        self._participant.inject_test_delay()
        self.command(tick.k, orders, reference, answer)
        self._to_answer = None

    def _has_begun(self, tick: Tick) -> bool:
        """Tick 0: whether all is under control that can be, and somebody hears the commands."""
        ready = (self._drives.armed(part, state) or not self._drives.can_arm(state) for part, state in tick.parts.items())
        return all(ready) and self._commands.heard

    def _answer(self) -> None:
        """The tick is answered when no part is being armed any more."""
        if self._to_answer is not None and not self._drives.asking:
            (k, answer), self._to_answer = self._to_answer, None
            busy = busy_owners(self._actions.values())
            self._participant.done(k, ok=answer.ok, busy=busy, including=answer.including)
