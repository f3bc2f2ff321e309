# SPDX-License-Identifier: Apache-2.0
"""A robot_sim of your own: puts a hobby arm, or any motors that take positions, on the bus in the place of the simulated robot.

`Servos` is the hardware; its servos are simulated here. To drive real ones, change its method `exchange`. The safety gate, the
ownership of parts and the emergency stop are those of the shipped robot_sim, and must stay between the bus and the motors.

    mobee router                                             # each in a terminal of its own
    python examples/bus/own_robot.py --robot my_arm.xml
    mobee conform --robot my_arm.xml                         # plays the controller, and prints violations of the contract

In a scenario it takes the place of the shipped one: `[services.robot_sim]` with `module = "my_package"`, a package that has this file as
`__main__.py`, and its `Config` in `config.py`. docs/hardware.md explains the contract.
"""

from __future__ import annotations

import secrets
import time
from pathlib import Path

import numpy as np

import mobee_system  # noqa: F401  (puts the packages of the live system on the path)
from bus_schema import VERSION, keys
from bus_schema.messages import Clock
from bus_schema.rpc import Done, Empty
from mobee.robot.robot import Robot
from services.common.config import ServiceConfig, load_config
from services.common.emergency_stop import StopRecord
from services.common.entry import explained, robot_of
from services.common.rate import Rate
from services.common.service import Service
from services.robot_sim.gate import Limits
from services.robot_sim.guard import Guard
from services.robot_sim.sensors import Sensors, part_meta


class Config(ServiceConfig, frozen=True, kw_only=True):
    """Settings of this robot_sim, from a settings file and options of the command line. Add your own fields, such as the serial port."""

    rate: float = 50.0
    """Ticks a second."""
    stop_record: str = ""
    """File in which an emergency stop is kept until it is reset; the launcher names it."""
    lag: float = 0.05
    """Time constant of the simulated servos, s."""


class Servos:
    """The motors: positions and velocities (n,) in rad, rad/s, in the order of the robot file."""

    def __init__(self, robot: Robot, config: Config) -> None:
        limits = [Limits.of(robot, part) for part in robot.parts]
        self._slowing = np.concatenate([one.acceleration for one in limits]) / config.rate  # rad/s per tick, when a part has to hold
        self._low, self._high = robot.limits.T
        self._lag = config.lag
        self.q = robot.home.copy()  # present positions of the servos: read them from the servos
        self.motor_velocities = np.zeros(len(self.q))
        self.efforts = np.zeros(len(self.q))  # N m; 0 if the servos do not measure it
        self._target, self._speed = self.q.copy(), np.zeros(len(self.q))  # rad, rad/s: the command of the servos
        self._orders: dict[int, tuple[slice, str, np.ndarray | None]] = {}  # by the first motor of the part

    def command(self, part: slice, mode: str, reference: np.ndarray | None) -> None:
        """Store the command that the safety gate (the last check before the motors) passes for a part in this tick.

        `part`: indices of the part's motors. `mode`: "position", "velocity", "torque" or "hold"; in hold the part brakes and stands still.
        `reference`: (n_part,) in rad, rad/s or N m, by mode; None in hold.
        """
        self._orders[part.start] = (part, mode, reference)

    def encoders(self, k: int, dt: float) -> np.ndarray:
        """Return the positions that the encoders measure, (n,) rad.

        `k`: the tick. `dt`: duration of a tick [s]. This robot uses neither.
        """
        return self.q.copy()

    def step(self, dt: float) -> None:
        """Compute positions for the servos from the commands, send them, and read the measured positions."""
        for part, mode, reference in self._orders.values():
            if mode == "position":
                self._speed[part] = (reference - self._target[part]) / dt
            elif mode == "velocity":
                self._speed[part] = reference
            else:  # hold: brake, then stay; a torque cannot be given to such servos
                speed = self._speed[part]
                self._speed[part] = np.sign(speed) * np.maximum(np.abs(speed) - self._slowing[part], 0.0)
        self._target = np.clip(self._target + dt * self._speed, self._low, self._high)
        self.exchange(self._target, dt)

    def exchange(self, target: np.ndarray, dt: float) -> None:
        """Send the targets to the servos and read positions and velocities: here the servos are simulated."""
        share = 1.0 - np.exp(-dt / self._lag)
        self.motor_velocities = share * (target - self.q) / dt
        self.q = self.q + dt * self.motor_velocities


class OwnRobot:
    """The process that takes the place of robot_sim: it drives the motors with the commands that pass the safety gates.

    In every tick it lets the gates check the commands, moves the motors, and publishes `tick`, `clock` and the state of each part.
    """

    def __init__(self, service: Service, config: Config, robot: Robot) -> None:
        self.service, self.config, self.robot = service, config, robot
        self.dt_ns = round(1e9 / config.rate)
        self.motors = Servos(robot, config)
        service.bus.run, service.bus.dt = f"run_{secrets.token_hex(4)}", self.dt_ns
        record = StopRecord(Path(config.stop_record)) if config.stop_record else None
        self.guard = Guard(service, robot, self, self.dt_ns * 1e-9, record)  # reads self.motors
        self.sensors = Sensors(service.bus, robot, self.dt_ns * 1e-9)
        self.clock = service.bus.publisher(Clock)
        service.describe = lambda: (f"own robot, tick {service.bus.k}", {"ticks": service.bus.k})
        service.on_request(keys.sim("reset"), Empty, self.reset)
        for part in robot.parts:
            service.on_request(keys.meta(part), Empty, lambda request, key: part_meta(robot, key.split("/")[0]))

    def reset(self, request: Empty, key: str) -> Done:
        """Begin a new run: all parts are idle and without an owner, and the tick is 0."""
        self.service.bus.run, self.service.bus.k, self.service.bus.t = f"run_{secrets.token_hex(4)}", 0, 0
        self.guard.reset()
        self.sensors.reset()
        return Done(v=VERSION)

    def run(self) -> None:
        """Run ticks until a signal or a shutdown call."""
        rate = Rate(self.dt_ns * 1e-9)
        router_check = time.monotonic()
        while True:
            self.service.spin(rate.next())  # handles commands, calls and emergency stops until the next tick is due
            if time.monotonic() >= router_check:
                self.service.check_router()
                router_check = time.monotonic() + 1.0
            self.tick()

    def tick(self) -> None:
        """Let the commands in force act, then publish the positions of the motors."""
        bus = self.service.bus
        bus.k, bus.t = bus.k + 1, bus.t + self.dt_ns
        self.guard.tick(bus.k)
        self.motors.step(self.dt_ns * 1e-9)
        self.sensors.sample_now(self.motors, self.guard.gates)
        self.sensors.publish("free", self.dt_ns, 1.0)
        self.clock.put(dt=self.dt_ns, mode="free", rate=1.0)


def main() -> None:
    """Serve until a signal or a shutdown call."""
    config = load_config(Config, None, "own_robot")
    with explained("own_robot"):
        robot = robot_of(config)
        with Service("robot_sim", config, robot, prompt=True) as service:
            own = OwnRobot(service, config, robot)
            service.ready()
            own.run()


if __name__ == "__main__":
    main()
