"""The motors of a simulated robot: lag, delay, backlash, encoder noise, hard stops."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.control.modality import FRICTION, INERTIA
from mobee.errors import InvalidValue
from mobee.robot.robot import Array, Robot

Mode = Literal["position", "velocity", "torque", "hold"]

NOISE_PERIOD = 0.02  # s, the tick for which the encoder noise is given
SERVO_GAIN = 8.0  # 1/s, position mode and a hold that has come to rest


@dataclass(frozen=True, slots=True, kw_only=True)
class MotorParameters:
    """What makes the robot not repeat itself; the defaults are those that bring out the published findings."""

    lag: float = 0.05  # s, time constant of the first-order response to a velocity
    delay: float = 0.02  # s, before a command begins to act
    backlash: float = np.deg2rad(0.2)  # rad, play between motor and joint side
    encoder_noise: float = np.deg2rad(0.1)  # rad, standard deviation of the white noise at a tick of 20 ms
    substep: float = 0.005  # s, at most, between two steps of the motors

    def __post_init__(self) -> None:
        for name in ("lag", "delay", "backlash", "encoder_noise"):
            if not 0 <= getattr(self, name) < np.inf:
                raise InvalidValue(f"motor {name} {getattr(self, name)}: must be finite and not negative")
        if not 0 < self.substep < np.inf:
            raise InvalidValue(f"motor substep {self.substep} s: must be a finite time above 0")

    @classmethod
    def ideal(cls) -> MotorParameters:
        """Motors that do at once and exactly what they are told, read without noise."""
        return cls(lag=0.0, delay=0.0, backlash=0.0, encoder_noise=0.0)

    def substeps(self, dt: float) -> int:
        """Into how many substeps a tick of dt [s] is cut."""
        return max(1, int(np.ceil(dt / self.substep - 1e-9)))


class Motors:
    """All motors of a robot, advanced together; arrays are (n,) in the order of `robot.motors`.

    Each substep: `drive`, then either `integrate` (the joint side is this class's own, with hard stops) or
    `adopt` (the joint side is what a physics engine says it has become).
    """

    def __init__(self, robot: Robot, parameters: MotorParameters, seed: int, q: Array) -> None:
        """Start at rest at q (n,) rad, every motor in hold."""
        n = len(robot.motor_table)
        if np.shape(q) != (n,):
            raise InvalidValue(f"q of shape {np.shape(q)}: must be ({n},), a position for every motor of {robot.name}")
        self.parameters = parameters
        self.q = np.array(q, dtype=float)  # rad, joint side
        self.velocities = np.zeros(n)  # rad/s, joint side
        self.efforts = np.zeros(n)  # N m
        self._limits = robot.limits
        self._max_velocity = np.array([m.max_velocity for m in robot.motor_table])
        self._max_acceleration = np.array([m.max_acceleration for m in robot.motor_table])
        self._max_torque = np.array([m.max_torque for m in robot.motor_table])
        self._motor_q = self.q.copy()  # rad, motor side of the play
        self._motor_v = np.zeros(n)  # rad/s
        self._dragged = self.q.copy()  # rad, where the motor side pulls the joint side
        self._dt = parameters.substep
        self._rest = self.q.copy()  # rad, where a hold stays
        self._resting = np.ones(n, dtype=bool)
        self._mode: NDArray[np.str_] = np.full(n, "hold", dtype="<U8")
        self._reference = np.zeros(n)
        self._line: list[Array] = []  # inputs on their way to the motors, the oldest first
        self._set_masks()
        self._rng = np.random.default_rng(seed)

    @property
    def motor_velocities(self) -> Array:
        """Velocities [rad/s] on the motor side of the play, (n,); a copy is not needed, every substep makes a new array."""
        return self._motor_v

    def command(self, where: slice, mode: Mode, reference: Array | None = None) -> None:
        """Set what is in force for the motors `where`: rad, rad/s or N m by mode; a hold has no reference.

        A hold decelerates at once, without the delay of the line, and then keeps the position reached.
        """
        if reference is not None:
            self._reference[where] = reference
        if (self._mode[where] == mode).all():
            return
        entering = np.zeros(len(self.q), dtype=bool)
        entering[where] = self._mode[where] != mode
        self._mode[where] = mode
        self._resting[entering] = False
        still = np.where(self._mode == "torque", 0.0, self._motor_v)
        self._line = [np.where(entering, still, on_its_way) for on_its_way in self._line]
        self._set_masks()

    def drive(self, dt: float) -> Array:
        """Advance the motor side by one substep of dt [s]; the joint-side velocity [rad/s] it asks for, (n,).

        That is zero while the play is not taken up.
        """
        before = self._motor_v
        self._motor_v = self._respond(self._delayed(self._input(), dt), dt)
        if self._any_hold:
            self._motor_v = np.where(self._is_hold, self._held(before, dt), self._motor_v)
        self.efforts = INERTIA * (self._motor_v - before) / dt + FRICTION * self._motor_v
        self._motor_q = self._motor_q + self._motor_v * dt
        play = self.parameters.backlash / 2.0
        self._dragged = self.q.clip(self._motor_q - play, self._motor_q + play)
        self._dt = dt
        velocity: Array = (self._dragged - self.q) / dt
        return velocity

    def integrate(self) -> None:
        """Kinematic joint side: go where `drive` asked, as far as the hard stops."""
        self.adopt(self._dragged.clip(self._limits[:, 0], self._limits[:, 1]))

    def adopt(self, q: Array) -> None:
        """Take the joint side (n,) rad at the end of the substep, as a physics engine says.

        The motor side follows into the play: nothing winds up while a joint is blocked.
        """
        self.velocities = (q - self.q) / self._dt
        self.q = np.array(q)
        play = self.parameters.backlash / 2.0
        self._motor_q = self._motor_q.clip(self.q - play, self.q + play)

    def encoders(self, dt: float, where: slice = slice(None)) -> Array:
        """The joint positions [rad] with white noise whose strength does not depend on the tick dt [s]."""
        noise = self.parameters.encoder_noise
        if noise == 0.0:
            return self.q[where].copy()
        q = self.q[where]
        noisy: Array = q + self._rng.standard_normal(len(q)) * (noise * np.sqrt(NOISE_PERIOD / dt))
        return noisy

    def _set_masks(self) -> None:
        self._is_hold = self._mode == "hold"
        self._is_position = self._mode == "position"
        self._is_torque = self._mode == "torque"
        self._any_hold = bool(self._is_hold.any())
        self._any_position = bool(self._is_position.any())
        self._any_torque = bool(self._is_torque.any())

    def _input(self) -> Array:
        """What enters the delay line: a torque [N m] in torque mode, else a velocity [rad/s]."""
        wanted: Array = self._reference.clip(-self._max_velocity, self._max_velocity)
        if self._any_position:
            wanted = np.where(self._is_position, self._servo(self._reference), wanted)
        if self._any_torque:
            wanted = np.where(self._is_torque, self._reference.clip(-self._max_torque, self._max_torque), wanted)
        return wanted

    def _servo(self, position: Array) -> Array:
        velocity: Array = (SERVO_GAIN * (position - self._motor_q)).clip(-self._max_velocity, self._max_velocity)
        return velocity

    def _delayed(self, wanted: Array, dt: float) -> Array:
        steps = round(self.parameters.delay / dt)
        if len(self._line) < steps:  # at the start, or when the substep has changed
            still = np.where(self._is_torque, 0.0, self._motor_v)
            self._line = [still] * (steps - len(self._line)) + self._line
        self._line.append(wanted)
        delayed = self._line[-steps - 1]
        self._line = self._line[-steps:] if steps else []
        return delayed

    def _respond(self, delayed: Array, dt: float) -> Array:
        lag = self.parameters.lag
        share = 1.0 - np.exp(-dt / lag) if lag else 1.0
        velocity = self._motor_v + share * (delayed - self._motor_v)
        if self._any_torque:
            push = (delayed - FRICTION * self._motor_v) / INERTIA
            push = push.clip(-self._max_acceleration, self._max_acceleration)
            driven = (self._motor_v + push * dt).clip(-self._max_velocity, self._max_velocity)
            velocity = np.where(self._is_torque, driven, velocity)
        return velocity

    def _held(self, before: Array, dt: float) -> Array:
        """Brake to rest, then stay where that was."""
        change = self._max_acceleration * dt
        arrived = ~self._resting & (np.abs(before) <= change)
        self._rest = np.where(arrived, self._motor_q, self._rest)
        self._resting = self._resting | arrived
        braking = before - before.clip(-change, change)
        return np.where(self._resting, self._servo(self._rest), braking)
