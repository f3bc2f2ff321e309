# SPDX-License-Identifier: Apache-2.0
"""The motors of a simulated robot: lag, delay, backlash, friction, encoder noise, hard stops, and the parameters of these."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core import Table, address, numbers, view
from mobee._core import plant as core
from mobee.arrays import Array, Ints, checked_seed, is_number, real_array
from mobee.errors import InvalidValue
from mobee.model.masses import gravity_torque
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from mobee.simulation.identified import load_identified

PerMotor = float | Sequence[float]  # one number for all, or one for each motor of the robot


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorParameters:
    """Parameters of the simulated motors; with the defaults the simulation reproduces the findings of the thesis.

    lag, delay, backlash and friction are one number, or one for each motor in the order of `robot.motors`. If backlash or friction is one
    number, rotary motors have this value; for a sliding motor it is multiplied by a length [m] that is proportional to the motor's range
    (`mobee.robot.motor_units.fine_units`). Numbers for each motor are in its own unit, rad or m.

    Attributes:
        lag: s, time constant of the first-order response to a velocity command.
        delay: s, before a command begins to act.
        backlash: rad, play between motor and joint side.
        friction: rad/s, Coulomb friction, given as a velocity: at smaller commanded velocities a motor does not move; at larger ones its
            velocity is reduced by this number.
        encoder_noise: rad, standard deviation of the white noise at a tick of 20 ms; at a tick of dt it is multiplied by sqrt(20 ms / dt).
        substep: s, longest integration step of the motors; a tick is divided into equal substeps.
    """

    lag: PerMotor = 0.05
    delay: PerMotor = 0.02
    backlash: PerMotor = np.deg2rad(0.2)
    friction: PerMotor = 0.0
    encoder_noise: float = np.deg2rad(0.1)
    substep: float = 0.005

    def __post_init__(self) -> None:
        for name in ("lag", "delay", "backlash", "friction", "encoder_noise"):
            value = real_array(f"motor {name}", getattr(self, name))
            if value.ndim > (name != "encoder_noise") or not np.all((value >= 0.0) & (value < np.inf)):
                raise InvalidValue(f"motor {name} {getattr(self, name)}: must be finite and not negative")
            object.__setattr__(self, name, float(value) if value.ndim == 0 else tuple(value.tolist()))  # so that it can be compared
        if not (is_number(self.substep) and 0 < self.substep < np.inf):
            raise InvalidValue(f"motor substep {self.substep!r} s: must be a finite time above 0")
        object.__setattr__(self, "substep", float(self.substep))

    @classmethod
    def ideal(cls) -> MotorParameters:
        """Return parameters of motors that follow commands at once and exactly, with encoders without noise."""
        return cls(lag=0.0, delay=0.0, backlash=0.0, encoder_noise=0.0)

    @classmethod
    def identified(cls, robot_name: str) -> MotorParameters:
        """Return parameters that were fitted to the responses of the simulated robot `robot_name` (docs/plant.md).

        Raises UnknownName for a robot that has not been identified.
        """
        return cls(**load_identified(robot_name))

    def substeps(self, dt: float) -> int:
        """Return the number of substeps into which a tick of dt [s] is divided."""
        return max(1, int(np.ceil(dt / self.substep - 1e-9)))

    def of_motors(self, name: str, count: int) -> Array:
        """Return the parameter `name` for each of `count` motors, (count,), as it was given: a common number is repeated.

        The numbers are not converted for motors that slide; `of_robot` does this.

        Raises InvalidValue if the parameter is given for another number of motors.
        """
        value: Array = np.asarray(getattr(self, name), dtype=np.float64)
        if value.ndim == 1 and len(value) != count:
            raise InvalidValue(f"motor {name} of {len(value)} motors: the robot has {count}; give one number, or one for each motor.")
        return np.array(np.broadcast_to(value, (count,)))

    def of_robot(self, name: str, robot: Robot) -> Array:
        """Return the parameter `name` for each motor of a robot, (n,).

        Lag and delay are in s. Backlash [rad] and friction [rad/s] are in m and m/s for motors that slide. The encoder noise is in
        rad for all motors; `Motors.noise` converts it to m. Raises InvalidValue if the parameter is given for another number of motors.
        """
        values = self.of_motors(name, len(robot.motors))
        common = name in ("backlash", "friction") and np.ndim(getattr(self, name)) == 0
        return values * fine_units(robot) if common else values


class Braking:
    """Limits the commands of n motors tick by tick, so that the motors can always brake before their position limits.

    `velocity` (n,) rad/s and `position` (n,) rad are the current commands, at first 0; the methods change them in place.

    Args:
        lower: (n,) rad, position limits.
        upper: (n,) rad, position limits.
        fastest: (n,) rad/s, largest velocities.
        change: (n,) rad/s, largest change of the velocity in a tick.
        dt: duration of a tick [s].
    """

    def __init__(self, lower: Array, upper: Array, fastest: Array, change: Array, dt: float) -> None:
        self._bounds = [np.array(one, dtype=np.float64) for one in (lower, upper, fastest, change)]
        self._count = len(self._bounds[0])
        self.velocity, self.position = np.zeros(self._count), np.zeros(self._count)
        self._struct = core.Braking(self._count, *(address(one) for one in (*self._bounds, self.velocity)), dt)
        self._here, self._at = ctypes.addressof(self._struct), address(self.position)
        self._core = core.calls()

    def to_velocity(self, wanted: Array, q: Array) -> None:
        """Change `velocity` towards `wanted` (n,) rad/s, as far as the motors can accelerate in one tick.

        Before that, `wanted` is limited to velocities from which motors at q (n,) rad can stop before their position limits.
        """
        self._core.to_velocity(self._here, numbers(wanted, self._count), numbers(q, self._count))

    def to_position(self, wanted: Array) -> None:
        """Advance `position` by one tick towards `wanted` (n,) rad, such that it arrives there with velocity zero."""
        self._core.to_position(self._here, numbers(wanted, self._count), self._at)

    def runs_out(self, q: Array, moving: Array) -> bool:
        """Return whether any motor at q (n,) rad with the velocity `moving` (n,) rad/s can no longer stop before its position limit.

        A velocity that is too high by less than the largest change in one tick is tolerated.
        """
        return bool(self._core.runs_out(self._here, numbers(q, self._count), numbers(moving, self._count)))


Mode = Literal["position", "velocity", "torque", "hold"]

NOISE_PERIOD = 0.02  # s, the tick for which the encoder noise is given
SERVO_GAIN = 8.0  # 1/s, in position mode and in a hold at rest; as in core/motors.cpp
_HOLD, _TORQUE = core.MODES.index("hold"), core.MODES.index("torque")


class Motors:
    """All motors of a robot, advanced together. The properties return copies of arrays (n,), in the order of `robot.motors`.

    Without a physics engine, call `move`, which advances motors and joints. With one, do three things in each substep: call `drive`, let
    the engine compute the positions of the joints, and call `adopt` with them.

    At the start the robot rests, and every motor is in mode "hold", in which it keeps its position.

    Args:
        robot: the robot.
        parameters: parameters of the motors.
        seed: seed of the encoder noise, a whole number, at least 0.
        q: (n,) rad, positions at the start.
        alive: (n,) whether each motor is active; the others never move, and their encoders have no noise. None: all motors are active.

    Raises:
        InvalidValue: `q` has another shape, or the seed or the parameters are not valid.
    """

    def __init__(self, robot: Robot, parameters: MotorParameters, seed: int, q: Array, alive: NDArray[np.bool_] | None = None) -> None:
        n = len(robot.motor_table)
        if np.shape(q) != (n,):
            raise InvalidValue(f"q of shape {np.shape(q)}: must be ({n},), a position for every motor of {robot.name}")
        self.seed = checked_seed(seed) % 2**64
        self._robot = robot
        self.parameters = parameters
        self.living: Ints = np.arange(n) if alive is None else np.flatnonzero(alive)
        """Indices of the active motors, ascending."""
        self.state: Table = np.zeros(n, dtype=core.STATE)
        """The state of the motors, a row for each (`mobee._core.plant.STATE`); the ticks of a plant change this array in place."""
        self._rest(q)
        self.constants = _constants(robot, parameters)
        """The constants of each motor for the current length of substeps, a row for each (`mobee._core.plant.CONSTANTS`)."""
        self._lag, self._delay = parameters.of_robot("lag", robot), parameters.of_robot("delay", robot)
        self._line = np.zeros((1, n))
        self._noise_samples = np.empty((len(self.living), 4))
        self.struct = core.Motors(  # `begin_substeps` sets the delay line
            living=view(self.living), constants=view(self.constants), state=address(self.state),
            seed=self.seed, noise_samples=address(self._noise_samples), noise_tick=-1,
        )  # fmt: skip
        """The motors as the compiled core reads them."""
        self.address = ctypes.addressof(self.struct)
        self._core = core.calls()
        self._noise = 0.0, np.zeros(n)
        self._dt = 0.0
        self.begin_substeps(parameters.substep)

    def restart(self, seed: int, q: Array) -> None:
        """Start again like new motors with this seed, at rest at q (n,) rad, in mode "hold", in which motors keep their position.

        Commands that are still delayed have no effect.
        """
        self.seed = checked_seed(seed) % 2**64
        self._rest(q)
        self.struct.seed, self.struct.noise_tick = self.seed, -1

    def _rest(self, q: Array) -> None:
        self.state[:] = 0
        for name in ("q", "motor_q", "pulled_q", "hold_q"):
            self.state[name] = q
        self.state["mode"], self.state["holding"] = _HOLD, 1

    @property
    def q(self) -> Array:
        """Positions of the joints, on the output side of the backlash, (n,) rad."""
        return self.state["q"].copy()

    @property
    def velocities(self) -> Array:
        """Velocities of the joints, on the output side of the backlash, (n,) rad/s."""
        return self.state["velocity"].copy()

    @property
    def efforts(self) -> Array:
        """Torques that the motors exert, (n,) N m."""
        return self.state["effort"].copy()

    @efforts.setter
    def efforts(self, torque: Array) -> None:
        self.state["effort"] = torque

    @property
    def motor_velocities(self) -> Array:
        """Velocities of the motors, on the input side of the backlash, (n,) rad/s."""
        return self.state["motor_velocity"].copy()

    @property
    def torques(self) -> Array:
        """Torque commands that took effect in the last substep, after their delay, (n,) N m; 0 for motors that are not in torque mode."""
        return self.state["applied_torque"].copy()

    @property
    def in_torque(self) -> NDArray[np.bool_]:
        """Whether each motor is in torque mode, (n,) bool."""
        found: NDArray[np.bool_] = self.state["mode"] == _TORQUE
        return found

    @property
    def load(self) -> Array:
        """Torques from outside, such as gravity, that motors in torque mode must overcome, (n,) N m."""
        return self.state["load"].copy()

    @load.setter
    def load(self, torque: Array) -> None:
        self.state["load"] = torque

    def command(self, where: slice, mode: Mode, reference: Array | None = None) -> None:
        """Set the kind of command (`mode`) and the reference of the motors `where`, a range of indices.

        `reference`: (m,), rad, rad/s or N m by the mode; None for a hold. A hold decelerates at once, without the delay of other commands,
        and then keeps the position reached. Motors that enter torque mode compensate gravity until the first torque command takes effect.
        """
        if reference is not None:
            self.state["reference"][where] = reference
        code = core.MODES.index(mode)
        if (self.state["mode"][where] != code).any():
            if mode == "torque":
                self.load = gravity_torque(self._robot, self.q)
            for motor in range(*where.indices(len(self.state))):
                self._core.enter(self.address, motor, code)

    def drive(self, dt: float) -> Array:
        """Advance the motors by one substep of dt [s]; return the velocities that they give the joints, (n,) rad/s.

        The joints themselves do not move; `adopt` sets their positions. The velocity of a joint is zero while its motor moves within the
        backlash.
        """
        self.begin_substeps(dt)
        self._core.drive(self.address, dt)
        velocity: Array = (self.state["pulled_q"] - self.state["q"]) / dt
        return velocity

    def move(self, substeps: int, dt: float) -> None:
        """Advance motors and joints by `substeps` substeps of dt [s]; nothing blocks the joints except the hard stops at their limits.

        The commands and the `load` (torques from outside, such as gravity) are constant during these substeps.
        """
        self.begin_substeps(dt)
        self._core.move(self.address, substeps, dt)

    def adopt(self, q: Array) -> None:
        """Set the positions of the joints, q (n,) rad, at the end of a substep, as a physics engine has computed them.

        The motors are then adapted to these positions. A motor that is farther from its joint than the backlash allows is moved back to
        this bound; so a blocked joint also stops its motor. In torque mode a motor takes the position and the velocity of its joint.
        """
        self._core.adopt(self.address, numbers(q, len(self.state)), self._dt)

    def encoders(self, k: int, dt: float, where: slice = slice(None)) -> Array:
        """Return the encoder values at tick k: the positions of the joints plus white noise, rad, of the motors `where`.

        `dt`: duration of a tick [s]; the standard deviation of the noise is proportional to 1 / sqrt(dt), so that its power spectral
        density is the same for every dt. The random numbers depend only on the seed, the tick and the motor.
        """
        noisy = self.q
        self._core.read(self.address, k, self.noise(dt).tobytes(), address(noisy))
        return noisy[where]

    def noise(self, dt: float) -> Array:
        """Return the standard deviations of the encoders' noise for ticks of dt [s], (n,) rad, or m for motors that slide."""
        if self._noise[0] != dt:
            self._noise = dt, float(self.parameters.encoder_noise * np.sqrt(NOISE_PERIOD / dt)) * fine_units(self._robot)
        return self._noise[1]

    def begin_substeps(self, dt: float) -> None:
        """Set the length of substeps to dt [s]; commands that are still delayed keep their order."""
        if dt == self._dt:
            return
        self._dt = dt
        with np.errstate(divide="ignore"):
            self.constants["response"] = 1.0 - np.exp(-dt / self._lag)  # 1 without a lag
        before, delay = self.constants["delay"].copy(), np.round(self._delay / dt).astype(np.int64)
        rows, old = int(delay.max()) + 1, len(self._line)
        oldest_first = np.roll(self._line, old - 1 - self.struct.newest, axis=0)
        still = np.where(self.in_torque, self.state["load"], self.state["motor_velocity"])
        line = np.tile(still, (rows, 1))
        for motor, steps in enumerate(np.minimum(before, delay)):
            if steps:
                line[rows - steps :, motor] = oldest_first[old - steps :, motor]
        self.constants["delay"] = delay
        self._line = line
        self.struct.line, self.struct.rows, self.struct.newest = address(line), rows, rows - 1


def _constants(robot: Robot, parameters: MotorParameters) -> Table:
    """Return a table of the constants of each motor for the core, one row per motor, with the columns of `CONSTANTS`.

    Set are the limits of position, velocity, acceleration and torque, half of the backlash, and the friction; the other columns are 0.
    """
    table: Table = np.zeros(len(robot.motor_table), dtype=core.CONSTANTS)
    table["low"], table["high"] = robot.limits.T
    for name in ("max_velocity", "max_acceleration", "max_torque"):
        table[name] = [getattr(motor, name) for motor in robot.motor_table]
    table["half_backlash"] = parameters.of_robot("backlash", robot) / 2.0
    table["friction"] = parameters.of_robot("friction", robot)
    return table
