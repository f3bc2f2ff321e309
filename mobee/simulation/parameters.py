"""What makes a simulated robot not repeat itself: the numbers of its motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Array, Robot
from mobee.simulation.identified import load_identified

PerMotor = float | Sequence[float]  # one number for all, or one for each motor of the robot


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorParameters:
    """The defaults are those that bring out the published findings.

    `lag`, `delay`, `backlash` and `friction`: one number, or one for each motor in the order of `robot.motors`.  `friction` is
    Coulomb's, as the velocity that it costs: a motor sticks while it is told less, and turns slower by it when it is told more.
    One number for all is that of motors that turn, and follows the range of those that slide (`mobee.robot.motor_units`); numbers for
    each motor are in its own unit, rad or m.
    """

    lag: PerMotor = 0.05  # s, time constant of the first-order response to a velocity
    delay: PerMotor = 0.02  # s, before a command begins to act
    backlash: PerMotor = np.deg2rad(0.2)  # rad, play between motor and joint side
    friction: PerMotor = 0.0  # rad/s
    encoder_noise: float = np.deg2rad(0.1)  # rad, standard deviation of the white noise at a tick of 20 ms
    substep: float = 0.005  # s, at most, between two steps of the motors

    def __post_init__(self) -> None:
        for name in ("lag", "delay", "backlash", "friction", "encoder_noise"):
            value = np.asarray(getattr(self, name), dtype=np.float64)
            if value.ndim > (name != "encoder_noise") or not np.all((value >= 0.0) & (value < np.inf)):
                raise InvalidValue(f"motor {name} {getattr(self, name)}: must be finite and not negative")
            object.__setattr__(self, name, float(value) if value.ndim == 0 else tuple(value.tolist()))  # so that it can be compared
        if not 0 < self.substep < np.inf:
            raise InvalidValue(f"motor substep {self.substep} s: must be a finite time above 0")

    @classmethod
    def ideal(cls) -> MotorParameters:
        """Motors that do at once and exactly what they are told, read without noise."""
        return cls(lag=0.0, delay=0.0, backlash=0.0, encoder_noise=0.0)

    @classmethod
    def identified(cls, robot_name: str) -> MotorParameters:
        """Numbers fitted to the responses of the simulated robot of that name (docs/plant.md); raises UnknownName with the nearest."""
        return cls(**load_identified(robot_name))

    def substeps(self, dt: float) -> int:
        """Into how many substeps a tick of dt [s] is cut."""
        return max(1, int(np.ceil(dt / self.substep - 1e-9)))

    def of_motors(self, name: str, count: int) -> Array:
        """One of the four for each of that many motors, (n,); raises InvalidValue if it is given for another number of them."""
        value: Array = np.asarray(getattr(self, name), dtype=np.float64)
        if value.ndim == 1 and len(value) != count:
            raise InvalidValue(f"motor {name} of {len(value)} motors: the robot has {count}; give one number, or one for each motor.")
        return np.array(np.broadcast_to(value, (count,)))

    def of_robot(self, name: str, robot: Robot) -> Array:
        """One of the four for each motor of a robot, in the unit of the motor, (n,); raises InvalidValue as `of_motors` does."""
        values = self.of_motors(name, len(robot.motors))
        common = name in ("backlash", "friction") and np.ndim(getattr(self, name)) == 0
        return values * fine_units(robot) if common else values
