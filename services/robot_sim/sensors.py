"""What the parts report: encoders between the start and the end of a tick, each part at its own time; in lockstep at its start."""

from __future__ import annotations

import hashlib

from bus_schema import keys
from bus_schema.messages import State
from mobee.robot.robot import Array, Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.robot_sim.gate import Gate


class Sensors:
    """The state streams."""

    def __init__(self, bus: Bus, robot: Robot, dt: float) -> None:
        self._bus, self._robot, self._dt = bus, robot, dt
        self._streams = {part: bus.publisher(keys.state(part), State, bus.control) for part in robot.parts}
        self._before: tuple[Array, Array]
        self.forget()

    def forget(self) -> None:
        """A new run."""
        self._hash = hashlib.sha256()

    @property
    def hash(self) -> str:
        """Of q, dq, mode and gate of every part at every tick from 1 on, in lockstep."""
        return self._hash.hexdigest()

    def begin(self, motors: Motors) -> None:
        """The tick begins: remember where everything is."""
        self._before = (motors.q.copy(), motors.motor_velocities.copy())

    def publish(self, part: str, share: float, motors: Motors, gate: Gate) -> None:
        """The part as it is after that share of the tick, with encoder noise; velocity from the motor side."""
        where = self._robot.parts[part].slice
        q_before, dq_before = self._before[0][where], self._before[1][where]
        q, dq = motors.q[where], motors.motor_velocities[where]
        noise = motors.encoders(self._bus.k, self._dt, where) - q
        t = self._bus.t + round(share * self._dt * 1e9)
        self._put(part, t, q_before + share * (q - q_before) + noise, dq_before + share * (dq - dq_before), motors.efforts[where], gate)

    def publish_now(self, motors: Motors, gates: dict[str, Gate]) -> None:
        """All parts as they are now, at the beginning of the tick; tick 0, in which nothing moves, is read without noise."""
        k = self._bus.k
        encoders = motors.encoders(k, self._dt) if k else motors.q
        velocities, efforts = motors.motor_velocities, motors.efforts
        for part, gate in gates.items():
            where = self._robot.parts[part].slice
            q, dq = encoders[where], velocities[where]
            self._put(part, self._bus.t, q, dq, efforts[where], gate)
            if k:
                self._hash.update(q.tobytes() + dq.tobytes() + f"{gate.mode} {gate.state}".encode())

    def _put(self, part: str, t: int, q: Array, dq: Array, efforts: Array, gate: Gate) -> None:
        self._streams[part].put(
            t=t,
            q=q.tolist(),
            dq=dq.tolist(),
            tau=efforts.tolist(),
            mode=gate.mode,
            gate=gate.state,
            faults=gate.faults,
            epoch=gate.epoch,
            cmd_seq=gate.seq,
            cmd_age=gate.age,
        )
