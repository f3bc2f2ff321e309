"""Watches the physics tick by tick: counts contacts, detects rest, publishes `sim/truth`, records files."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bus_schema.messages import ObjectTruth, Truth
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.world import World
from mobee.robot.robot import Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.robot_sim.counters import MOVING, Counters
from services.robot_sim.guard import Guard
from services.robot_sim.kinematic import Backend, SolidContact

POSITIONS = "q.f64"  # a row of n float64 [rad] a tick, the first at the end of tick 1
CONTACTS = "contacts.csv"  # tick, pair, depth [m]; nothing for a tick without contact


class Recorded:
    """A back-end that keeps the joint positions, without noise, and the solid contacts of every tick.

    Both files begin anew with every run; what was written is in them even when the process is killed.
    """

    def __init__(self, inner: Backend, folder: Path) -> None:
        """Raises InvalidValue for a folder that cannot be written."""
        self._inner = inner
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._positions = (folder / POSITIONS).open("wb", buffering=0)
            self._contacts = (folder / CONTACTS).open("w", buffering=1)
        except OSError as error:
            raise InvalidValue(f"record: cannot write {error.filename} ({error.strerror})") from None
        self.pairs_watched = inner.pairs_watched
        self._begin()

    @property
    def motors(self) -> Motors:
        """See Backend."""
        return self._inner.motors

    @property
    def world(self) -> World:
        """See Backend."""
        return self._inner.world

    def step(self, dt: float) -> None:
        """See Backend."""
        self._inner.step(dt)
        self._k += 1
        self._positions.write(self._inner.motors.q.tobytes())
        for pair, depth in self._inner.contacts().items():
            self._contacts.write(f"{self._k},{pair},{depth:.6g}\n")

    def reset(self, seed: int) -> None:
        """See Backend."""
        self._inner.reset(seed)
        self._begin()

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """See Backend."""
        self._inner.place(name, position)

    def contact(self) -> SolidContact:
        """See Backend."""
        return self._inner.contact()

    def contacts(self) -> Mapping[str, float]:
        """See Backend."""
        return self._inner.contacts()

    def gap(self) -> float:
        """See Backend."""
        return self._inner.gap()

    def _begin(self) -> None:
        self._k = 0
        for file in (self._positions, self._contacts):
            file.seek(0)
            file.truncate()
        self._contacts.write("k,pair,depth\n")


NOT_FINITE = 1  # fault bit


class Watch:
    """Looks at the backend after every step."""

    def __init__(self, bus: Bus, robot: Robot, backend: Backend, guard: Guard, truth_period: int) -> None:
        """`truth_period`: ticks between two messages of the truth."""
        self._bus, self._robot, self._backend, self._guard = bus, robot, backend, guard
        self._truth = bus.publisher(Truth)
        self._truth_period = truth_period
        self._deepest = SolidContact()  # since the last truth message
        self.counters = Counters()

    def mark(self, missed: int) -> None:
        """A measurement begins; `missed`: ticks skipped until now."""
        self.counters = Counters()
        self.counters.missed_before = missed

    def forget(self) -> None:
        """A new run."""
        self.counters.stops.forget()

    def look(self) -> None:
        """Once a tick, after the physics."""
        gates = self._guard.gates
        self.counters.count_gates(gates.values())
        contact = self._backend.contact()
        self.counters.count_contact(contact)
        if contact.depth > self._deepest.depth:
            self._deepest = contact
        q = self._backend.motors.q
        if not math.isfinite(q.dot(q)) and not np.isfinite(q).all():  # the first costs a third of the second
            for gate in gates.values():
                gate.fail(NOT_FINITE, "the physics has no finite answer any more")
        self._watch_stops(q)

    def _watch_stops(self, all_q: Array) -> None:
        now, stops = self._bus.t, self.counters.stops
        fast = (np.abs(self._backend.motors.motor_velocities) > MOVING).tolist()
        for part, gate in self._guard.gates.items():
            where = self._robot.parts[part].slice
            q, moves = all_q[where], any(fast[where])
            if gate.mode != "hold":
                stops.obeys(part, now, q, moves)
                continue
            stopped = stops.look(part, now, q, moves)
            if stopped:
                self._bus.event("info", "stopped", f"{part} came to rest", time=stopped[0], distance=stopped[1])

    def tell(self) -> None:
        """Once a tick: the truth, where it is time and somebody listens."""
        if self._bus.k % self._truth_period:
            return
        gap = self._backend.gap()
        self.counters.count_gap(gap)
        if not self._truth.heard:
            return
        self._truth.put(
            q=self._backend.motors.q.tolist(),
            depth=self._deepest.depth,
            pair=self._deepest.pair,
            gap=gap,
            objects=[
                ObjectTruth(name=thing.name, position=thing.position.tolist(), quaternion=quaternion_from_matrix(thing.rotation).tolist())
                for thing in self._backend.world.objects.values()
            ],
        )
        self._deepest = SolidContact()
