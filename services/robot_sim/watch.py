"""What came of the physics, tick by tick: counted, watched for parts that come to rest, and told on `sim/truth`."""

from __future__ import annotations

import math

import numpy as np

from bus_schema import keys
from bus_schema.messages import ObjectTruth, Truth
from mobee.kinematics.quaternion import from_matrix
from mobee.robot.robot import Array, Robot
from services.common.bus import Bus
from services.common.delivery import DATA
from services.robot_sim.backend import Backend, SolidContact
from services.robot_sim.counters import Counters
from services.robot_sim.guard import Guard
from services.robot_sim.stops import MOVING

NOT_FINITE = 1  # fault bit


class Watch:
    """Looks at the backend after every step."""

    def __init__(self, bus: Bus, robot: Robot, backend: Backend, guard: Guard, truth_period: int) -> None:
        """`truth_period`: ticks between two messages of the truth."""
        self._bus, self._robot, self._backend, self._guard = bus, robot, backend, guard
        self._truth = bus.publisher(keys.SIM_TRUTH, Truth, DATA)
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
                ObjectTruth(name=thing.name, position=thing.position.tolist(), quaternion=from_matrix(thing.rotation).tolist())
                for thing in self._backend.world.objects.values()
            ],
        )
        self._deepest = SolidContact()
