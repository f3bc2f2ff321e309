"""What the parts report: encoders between the start and the end of a tick, each part at its own time."""

from __future__ import annotations

from bus_schema import keys
from bus_schema.messages import State
from mobee.robot.robot import Array, Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.common.delivery import LATEST
from services.robot_sim.gate import Gate


class Sensors:
    """The state streams."""

    def __init__(self, bus: Bus, robot: Robot, dt: float) -> None:
        self._bus, self._robot, self._dt = bus, robot, dt
        self._streams = {part: bus.publisher(keys.state(part), State, LATEST) for part in robot.parts}
        self._before: tuple[Array, Array]

    def begin(self, motors: Motors) -> None:
        """The tick begins: remember where everything is."""
        self._before = (motors.q.copy(), motors.motor_velocities.copy())

    def publish(self, part: str, share: float, motors: Motors, gate: Gate) -> None:
        """The part as it is after that share of the tick, with encoder noise; velocity from the motor side."""
        where = self._robot.parts[part].slice
        q_before, dq_before = self._before[0][where], self._before[1][where]
        q, dq = motors.q[where], motors.motor_velocities[where]
        noise = motors.encoders(self._dt, where) - q
        self._streams[part].put(
            t=self._bus.t + round(share * self._dt * 1e9),
            q=(q_before + share * (q - q_before) + noise).tolist(),
            dq=(dq_before + share * (dq - dq_before)).tolist(),
            tau=motors.efforts[where].tolist(),
            mode=gate.mode,
            gate=gate.state,
            faults=gate.faults,
            epoch=gate.epoch,
            cmd_seq=gate.seq,
            cmd_age=gate.age,
        )
