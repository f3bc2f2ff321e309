"""What the parts report: encoders between the start and the end of a tick, each part at its own time; in lockstep at its start.

The control chain gets the newest of all parts with every tick, in one message; a part's own stream is for whoever else listens.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Literal

import numpy as np

from bus_schema import keys
from bus_schema.chain import PartStatus, Tick
from bus_schema.messages import State
from mobee.robot.robot import Array, Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.robot_sim.gate import Gate


class Sensors:
    """The newest sample of every part, and the streams that tell of it."""

    def __init__(self, bus: Bus, robot: Robot, dt: float) -> None:
        self._bus, self._dt = bus, dt
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._streams = {part: bus.publisher(keys.state(part), State, bus.control) for part in robot.parts}
        self._tick = bus.publisher(keys.TICK, Tick, bus.control)
        n = len(robot.motors)
        self._q, self._dq, self._tau = np.zeros(n), np.zeros(n), np.zeros(n)
        self._shares = np.zeros(n)  # of the tick after which each motor was read
        self.forget()

    def forget(self) -> None:
        """A new run."""
        self._hash = hashlib.sha256()
        self._statuses: dict[str, PartStatus] = {}

    @property
    def hash(self) -> str:
        """Of q, dq, mode and gate of every part at every tick from 1 on, in lockstep."""
        return self._hash.hexdigest()

    def begin(self, motors: Motors) -> None:
        """The tick begins: remember where everything is."""
        self._q_before, self._dq_before = motors.q, motors.motor_velocities

    def sample(self, shares: Sequence[tuple[float, str]], motors: Motors, gates: Mapping[str, Gate]) -> None:
        """Read parts as they are after their shares of the tick, with encoder noise; velocity from the motor side."""
        q, dq, tau = motors.q, motors.motor_velocities, motors.efforts
        noise = motors.encoders(self._bus.k, self._dt) - q

        def read(where: slice, share: Array | float) -> None:
            q_before, dq_before = self._q_before[where], self._dq_before[where]
            self._q[where] = q_before + share * (q[where] - q_before) + noise[where]
            self._dq[where] = dq_before + share * (dq[where] - dq_before)
            self._tau[where] = tau[where]

        for share, part in shares:
            self._shares[self._where[part]] = share
        if len(shares) == len(self._where):  # at once: a quarter of the work
            read(slice(None), self._shares)
        else:
            for share, part in shares:
                read(self._where[part], share)
        for share, part in shares:
            self._report(part, self._bus.t + round(share * self._dt * 1e9), gates[part])

    def sample_now(self, motors: Motors, gates: Mapping[str, Gate]) -> None:
        """Read all parts as they are now, at the beginning of the tick; tick 0, in which nothing moves, is read without noise."""
        k = self._bus.k
        self._q = motors.encoders(k, self._dt) if k else motors.q
        self._dq, self._tau = motors.motor_velocities, motors.efforts
        for part, gate in gates.items():
            self._report(part, self._bus.t, gate)

    def publish(self, mode: Literal["free", "lock", "paused"], dt: int, rate: float) -> None:
        """The tick begins: tell the control chain, once every part was read."""
        if len(self._statuses) == len(self._where):
            self._tick.put(dt=dt, mode=mode, rate=rate, q=self._q.tolist(), parts=self._statuses)

    def digest(self) -> None:
        """Put what was read into the hash."""
        for part, status in self._statuses.items():
            where = self._where[part]
            self._hash.update(self._q[where].tobytes() + self._dq[where].tobytes() + f"{status.mode} {status.gate}".encode())

    def _report(self, part: str, t: int, gate: Gate) -> None:
        self._statuses[part] = PartStatus(self._bus.k, t, gate.mode, gate.state, gate.faults, gate.epoch, gate.seq, gate.age)
        stream = self._streams[part]
        if stream.heard:
            where = self._where[part]
            stream.put(
                t=t,
                q=self._q[where].tolist(),
                dq=self._dq[where].tolist(),
                tau=self._tau[where].tolist(),
                mode=gate.mode,
                gate=gate.state,
                faults=gate.faults,
                epoch=gate.epoch,
                cmd_seq=gate.seq,
                cmd_age=gate.age,
            )
