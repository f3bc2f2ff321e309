# SPDX-License-Identifier: Apache-2.0
"""Runs robot_sim, tick by tick.

A tick has four steps: the safety gates (the last check of commands) command the motors; the messages `Tick` and `Clock` are published; the
physics advances by a tick; then each part is read at its own sampling time, and its state is published. In lockstep all parts are read and
published before `Tick`.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Literal, NoReturn

from msgspec import Struct
from msgspec.structs import replace

from bus_schema import VERSION, keys
from bus_schema.messages import Clock
from bus_schema.rpc import Done, Empty, Pace, PartMeta, Place
from mobee.errors import MobeeError
from mobee.robot.robot import Robot
from services.common.emergency_stop import StopDatagrams, StopRecord
from services.common.listener import MAX_CLOCK_RATE
from services.common.rate import Rate
from services.common.service import CallRefused, Service
from services.robot_sim.choice import choose
from services.robot_sim.config import Config
from services.robot_sim.gate import Limits
from services.robot_sim.guard import Guard
from services.robot_sim.kinematic import Backend
from services.robot_sim.lockstep import START_PERIOD, Lockstep
from services.robot_sim.sensors import Phases, Sensors, errors_of, part_meta
from services.robot_sim.strength import with_torques
from services.robot_sim.watch import Watch

MIN_SPREAD_PERIOD = 0.0025  # s; in shorter ticks all parts are read at once, without waiting for their sampling times
IDLE_PERIOD = 1.0  # s between two checks of a run that is paused or over, in lockstep
MAX_PAUSE = 600.0  # s after which a pause ends by itself


class Pause(Struct, frozen=True):
    """A pause of the robot's time. `by`: name of the process that has requested the pause.

    `until`: time at which the pause ends by itself, s of the monotonic clock.
    """

    by: str
    until: float


class Node:
    """robot_sim as a service: makes the ticks, and connects safety gates (checks of commands), physics and encoders with the bus."""

    def __init__(self, service: Service, config: Config, robot: Robot, backend: Backend) -> None:
        self._service, self._config, self._robot, self._backend = service, config, robot, backend
        self._bus = service.bus
        self._dt_ns = round(1e9 / config.rate)
        self._dt = self._dt_ns / 1e9
        self._period = self._dt / config.speed  # s of real time a tick
        self._bus.run, self._bus.dt = _new_run(), self._dt_ns
        self._pause: Pause | None = None
        self._pace = 0.0  # lockstep: s of real time that a simulated second takes at least
        record = StopRecord(Path(config.stop_record)) if config.stop_record else None
        self._strong = with_torques(robot, config.torques)
        self._guard = Guard(service, self._strong, backend, self._dt, record, config.speed, self._open_datagrams())
        self._phases = Phases(tuple(robot.parts), config.jitter, config.seed)
        self._sensors = Sensors(self._bus, robot, self._dt, errors_of(robot, config.encoder_errors))
        self._clock = self._bus.publisher(Clock)
        self._clock_period = max(1, round(1.0 / (MAX_CLOCK_RATE * self._period)))  # ticks
        self._watch = Watch(self._bus, robot, backend, self._guard, max(1, round(config.rate / config.truth_rate)))
        self._rate = Rate(self._period)
        self._end_pause()
        self._lockstep = Lockstep(service, config.participants, self._guard, config.ticks) if service.locked else None
        if warning := choose(config.backend, robot).warning:
            self._bus.event("warning", "no_physics", warning)
        for note in backend.notes:
            self._bus.event("info", "backend", note)
        service.describe, service.words = self._describe, self._words
        service.mark = self._mark
        for verb, handler in (("reset", self._reset), ("pause", self._begin_pause), ("resume", self._resume)):
            service.on_request(keys.sim(verb), Empty, handler)
        service.on_request(keys.sim("place"), Place, self._place)
        service.on_request(keys.sim("pace"), Pace, self._set_pace)
        for part in robot.parts:
            service.on_request(keys.meta(part), Empty, self._meta)

    def _open_datagrams(self) -> StopDatagrams | None:
        """Return the receiver of stops without the router; None if the settings name no address for it, or if it cannot be used."""
        address = self._config.stop_address
        try:
            return StopDatagrams(address) if address else None
        except OSError as error:
            text = f"no stop is received at the UDP address {address}, only from bus and record: {error}"
            self._bus.event("warning", "stop_address", text)
            return None

    def run(self) -> None:
        """Run ticks until the process is asked to end."""
        if self._lockstep is not None:
            self._run_locked(self._lockstep)
        self._rate = Rate(self._period)
        router_check = time.monotonic()
        while True:
            deadline = self._rate.next()
            self._service.spin(deadline)
            now = time.monotonic()
            self._watch.counters.overtime.add((now - deadline) * 1e3)
            if now >= router_check:
                self._service.check_router()
                router_check = now + 1.0
            if not self._is_paused():
                self._tick(now)

    def _run_locked(self, lockstep: Lockstep) -> NoReturn:
        router_check = 0.0
        while True:
            if (now := time.monotonic()) >= router_check:
                self._service.check_router()
                router_check = now + 1.0
            if self._bus.k == 0 and not lockstep.is_complete():
                self._publish_start()
                self._service.spin(now + START_PERIOD, lockstep.is_complete)
            elif self._is_paused() or lockstep.is_over():
                self._service.spin(now + IDLE_PERIOD)
            else:
                self._tick_locked(lockstep)
                wait = self._period if lockstep.is_degraded() else self._dt * self._pace
                if wait:
                    self._service.spin(now + wait, partial(self._has_changed, self._pace, self._bus.run))

    def _has_changed(self, pace: float, run: str) -> bool:
        return (self._pace, self._bus.run) != (pace, run)

    def _tick_locked(self, lockstep: Lockstep) -> None:
        begin = time.monotonic()
        self._service.health.beats.note(begin)
        self._bus.k += 1
        self._bus.t += self._dt_ns
        self._guard.tick(self._bus.k)
        self._publish_start()
        self._sensors.digest()
        self._backend.step(self._dt)
        self._watch.counters.tick_time.add((time.monotonic() - begin) * 1e3)
        self._watch.measure()
        self._watch.publish_truth()
        lockstep.wait(self._bus.k)

    def _publish_start(self) -> None:
        """Lockstep: read all parts and publish the start of the tick."""
        self._sensors.sample_now(self._backend.motors, self._guard.gates)
        self._publish_tick("lock")

    def _tick(self, start: float) -> None:
        bus, backend = self._bus, self._backend
        self._service.health.beats.note(start)
        bus.k += 1
        bus.t += self._dt_ns
        self._guard.tick(bus.k)
        self._publish_tick("free")
        self._sensors.begin(backend.motors)
        backend.step(self._dt)
        self._watch.counters.tick_time.add((time.monotonic() - start) * 1e3)
        self._watch.measure()
        if self._read(start):
            self._watch.publish_truth()

    def _read(self, start: float) -> bool:
        """Read every part at its sampling time; returns False if a reset has ended the run meanwhile."""
        shares, motors, gates = self._phases.next(), self._backend.motors, self._guard.gates
        if self._period < MIN_SPREAD_PERIOD:
            self._sensors.sample(shares, motors, gates)
            return True
        run = self._bus.run
        for share, part in shares:
            self._service.spin(start + share * self._period)
            if self._bus.run != run:  # reset
                return False
            self._sensors.sample([(share, part)], motors, gates)
        return True

    def _publish_tick(self, mode: Literal["free", "lock", "paused"]) -> None:
        self._sensors.publish(mode, self._dt_ns, self._config.speed)
        if (mode != "free" or self._bus.k % self._clock_period == 0) and self._clock.has_subscribers:
            self._clock.put(dt=self._dt_ns, mode=mode, rate=self._config.speed)

    def _describe(self) -> tuple[str, Mapping[str, float]]:
        states = [gate.state for gate in self._guard.gates.values()]
        text = f"{self._backend.name} {self._config.rate:g} Hz, tick {self._bus.k}, {states.count('armed')} of {len(states)} parts armed"
        if self._pause is not None:
            text = f"paused by {self._pause.by}, for at most {max(0.0, self._pause.until - time.monotonic()):.0f} s more; {text}"
        if self._guard.stop_reason:
            text = f"{self._guard.stop_reason}; {text}"
        numbers = self._watch.counters.numbers(self._rate.missed, self._backend.pairs_watched)
        if self._lockstep is None:
            return text, numbers
        speed = self._lockstep.speed(self._dt)
        pace = f"lockstep at {speed:.1f} x real time" if self._bus.k > 0 else self._lockstep.startup_status()
        return f"{text}, {pace}", {**numbers, **self._lockstep.numbers(), "speed": speed}

    def _words(self) -> Mapping[str, str]:
        return {} if self._lockstep is None else {"states": self._sensors.hash}

    def _mark(self) -> None:
        self._watch.mark(self._rate.missed)

    def _reset(self, request: Empty, key: str) -> Done:
        self._require_pauser(request.who)
        self._backend.reset(self._config.seed)
        self._bus.run, self._bus.k, self._bus.t = _new_run(), 0, 0
        self._guard.reset()
        self._phases = Phases(tuple(self._robot.parts), self._config.jitter, self._config.seed)
        self._watch.reset()
        self._sensors.reset()
        if self._lockstep is not None:
            self._lockstep.begin()
        self._end_pause()
        self._bus.event("info", "new_run", f"reset by {request.who}: run {self._bus.run}")
        return Done(v=VERSION)

    def _begin_pause(self, request: Empty, key: str) -> Done:
        """Begin a pause, or prolong it for the service that has begun it."""
        self._require_pauser(request.who)
        if self._pause is None:
            self._guard.hold_all(f"paused by {request.who}")
            self._sensors.note_hold(self._guard.gates)
            self._note_disturbance("paused")
            self._publish_tick("paused")
        self._pause = Pause(request.who, time.monotonic() + MAX_PAUSE)
        self._service.expected_rate = None
        return Done(v=VERSION)

    def _resume(self, request: Empty, key: str) -> Done:
        self._require_pauser(request.who)
        self._end_pause()
        return Done(v=VERSION)

    def _require_pauser(self, who: str) -> None:
        """Refuse a call of another service than the one that has paused the robot, while that one runs."""
        pause = self._pause
        if pause is not None and who != pause.by and self._service.alive.get(pause.by):
            raise CallRefused("owned", f"{pause.by} has paused the robot, and only it can resume or reset the robot while it runs")

    def _is_paused(self) -> bool:
        """Return whether time stands still; a pause that was forgotten ends by itself."""
        if self._pause is not None and time.monotonic() > self._pause.until:
            self._bus.event("warning", "pause_over", f"the pause by {self._pause.by} lasted {MAX_PAUSE:g} s: the robot continues")
            self._end_pause()
        return self._pause is not None

    def _end_pause(self) -> None:
        self._pause = None
        self._service.expected_rate = None if self._service.locked else 1.0 / self._period

    def _place(self, request: Place, key: str) -> Done:
        x, y, z = request.position
        try:
            self._backend.place(request.name, (x, y, z))
        except MobeeError as error:
            raise CallRefused("object", str(error)) from None
        self._note_disturbance(f"{request.name} placed by {request.who}")
        return Done(v=VERSION)

    def _set_pace(self, request: Pace, key: str) -> Done:
        if self._lockstep is None:
            raise CallRefused("mode", 'the robot runs in real time; a pace can be set in lockstep only (shared.mode = "lock")')
        self._pace = 1.0 / request.speed if request.speed > 0.0 else 0.0
        return Done(v=VERSION)

    def _note_disturbance(self, why: str) -> None:
        if self._lockstep is not None and self._bus.k > 0:
            self._lockstep.note_flaw(why)

    def _meta(self, request: Empty, key: str) -> PartMeta:
        part = key.split("/")[0]
        return replace(part_meta(self._robot, part), max_torque=Limits.of(self._strong, part).torque.tolist())


def _new_run() -> str:
    return f"run_{secrets.token_hex(4)}"
