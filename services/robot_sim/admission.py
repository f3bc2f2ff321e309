"""Which orders are admitted to a part's motors, their limits, and how refusals are answered."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from bus_schema import Refused
from bus_schema.messages import Command, Commands, Mode
from mobee.arrays import Array
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from services.common.service import CallRefused


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Per motor of a part, each (n,)."""

    lower: Array  # rad
    upper: Array  # rad
    velocity: Array  # rad/s
    acceleration: Array  # rad/s^2
    torque: Array  # N m
    fine: Array  # what 1 rad of a threshold is in the unit of the motor, see mobee.robot.motor_units

    @classmethod
    def of(cls, robot: Robot, part: str) -> Limits:
        """As the robot file says."""
        motors = robot.motor_table[robot.part(part).slice]
        return cls(
            lower=np.array([m.limits[0] for m in motors]),
            upper=np.array([m.limits[1] for m in motors]),
            velocity=np.array([m.max_velocity for m in motors]),
            acceleration=np.array([m.max_acceleration for m in motors]),
            torque=np.array([m.max_torque for m in motors]),
            fine=fine_units(robot)[robot.part(part).slice],
        )


class Order(Struct, frozen=True, eq=False):
    """See `Command`; `reference` (n,) rad, rad/s or N m by mode."""

    src: str
    epoch: int
    seq: int
    re_k: int
    mode: Mode
    reference: Array
    ttl: int  # ms

    @classmethod
    def of(cls, command: Command) -> Order:
        """That of a command to one part."""
        return cls(command.src, command.epoch, command.seq, command.re_k, command.mode, np.array(command.ref), command.ttl)


def orders_of(commands: Commands, robot: Robot) -> dict[str, Order]:
    """Those of a message to several parts, by part; raises KeyError for one that the robot does not have."""
    reference = np.array(commands.ref)
    src, seq, re_k, ttl = commands.src, commands.seq, commands.re_k, commands.ttl
    return {
        part: Order(src, order.epoch, seq, re_k, order.mode, reference[robot.parts[part].slice], ttl)
        for part, order in commands.parts.items()
    }


@contextmanager
def refused_as_call() -> Iterator[None]:
    """Let the caller know."""
    try:
        yield
    except Refused as refused:
        raise CallRefused(refused.reason, str(refused)) from None


MAX_AGE = 0.1  # s between the tick an order answers and the tick it arrives in, in free mode
MAX_TTL = 1000  # ms
MARGIN = math.radians(1.0)  # rad by which a position may exceed its limit (encoder noise); it is then clipped
START = math.radians(2.0)  # rad between the measured position and the first position ordered
STEP = 2.0  # times the distance that full speed covers, by which a position reference may move

_EXACT = 1.0 + 1e-9  # a limit that went through the wire is still the limit


class Admission:
    """The checks of one part; each raises Refused with its reason."""

    def __init__(self, part: str, limits: Limits, dt: float, max_ticks: int | None) -> None:
        """`max_ticks`: how many ticks ago the one may be that an order answers; None: as many as begin in MAX_AGE."""
        self._part, self._dt, self._max_ticks = part, dt, max_ticks
        self._velocity, self._torque = limits.velocity * _EXACT, limits.torque * _EXACT
        self._margin, self._start = MARGIN * limits.fine, START * limits.fine
        self._lower, self._upper = limits.lower - self._margin, limits.upper + self._margin
        self._stride = STEP * limits.velocity * dt  # rad a tick
        self._most_strides = max_ticks or max(round(MAX_AGE / dt), 1)

    def check(self, order: Order, k: int) -> None:
        """Numbers and time of an order that arrives in tick k."""
        reference = order.reference
        if reference.shape != self._lower.shape:
            raise Refused("length", f"{self._part}: {reference.size} numbers for {self._lower.size} motors")
        if not self._is_within(order.mode, reference):  # so it is with NaN too
            self._refuse(order.mode, reference)
        if order.re_k > k:
            raise Refused("future", f"{self._part}: answers tick {order.re_k}, it is {k}")
        self._check_age(k - order.re_k)
        if not 0 < order.ttl <= MAX_TTL:  # 0 must not mean "indefinitely"
            raise Refused("ttl", f"{self._part}: ttl {order.ttl} ms, valid: 1 to {MAX_TTL}")

    def check_step(self, reference: Array, before: Array | None, ticks: int, q: Array) -> None:
        """The way from the position ordered `ticks` ago; None: from the measured q.  All (n,) rad."""
        if before is None:
            before, allowed = q, self._start
        else:
            allowed = self._stride * min(max(ticks, 1), self._most_strides)
        step = np.abs(reference - before)
        if (step > allowed).any():
            raise Refused("step", f"{self._part}: a jump of {step.max():.3f} rad, allowed {allowed[int(np.argmax(step - allowed))]:.3f}")

    def _check_age(self, ticks: int) -> None:
        if self._max_ticks is not None:
            if ticks > self._max_ticks:
                raise Refused("age", f"{self._part}: answers a tick {ticks} ticks ago, limit {self._max_ticks}")
        elif ticks * self._dt > MAX_AGE:
            raise Refused("age", f"{self._part}: answers a tick {ticks * self._dt * 1e3:.0f} ms ago, limit {MAX_AGE * 1e3:.0f} ms")

    def _is_within(self, mode: str, reference: Array) -> bool:
        if mode == "velocity":
            return _all(np.abs(reference) <= self._velocity)
        if mode == "position":
            return _all((reference >= self._lower) & (reference <= self._upper))
        if mode == "torque":
            return _all(np.abs(reference) <= self._torque)
        return _all(np.isfinite(reference))

    def _refuse(self, mode: str, reference: Array) -> None:
        """Say what is wrong."""
        if not np.isfinite(reference).all():
            raise Refused("value", f"{self._part}: NaN or infinity")
        if mode == "position":
            beyond, unit = (np.maximum(reference - self._upper, self._lower - reference) + self._margin).max(), "rad beyond a limit"
        elif mode == "velocity":
            beyond, unit = (np.abs(reference) - self._velocity / _EXACT).max(), "rad/s beyond the limit"
        else:
            beyond, unit = (np.abs(reference) - self._torque / _EXACT).max(), "N m beyond the limit"
        raise Refused(mode, f"{self._part}: {beyond:.3f} {unit}")


def _all(found: NDArray[np.bool_]) -> bool:
    """Whether each is true; of so few numbers that is three times as quick as their `all`."""
    return bool(np.count_nonzero(found) == found.size)
