# SPDX-License-Identifier: Apache-2.0
"""The safety gate of one part, the last check before its motors: which commands are admitted, and how references are limited.

Pure logic: the caller gives the time.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from msgspec import Struct
from numpy.typing import NDArray

from bus_schema import Refused
from bus_schema.messages import Command, Commands, GateState, Mode
from mobee.arrays import Array
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from mobee.simulation.motors import SERVO_GAIN, Braking
from services.common.service import CallRefused


@dataclass(frozen=True, slots=True, eq=False)
class Limits:
    """Limits of the motors of a part, each of shape (n_part,).

    `lower`, `upper`: rad. `velocity`: rad/s. `acceleration`: rad/s^2. `torque`: N m. `fine`: factor that converts a small threshold from
    rad to the motor's own unit. It is 1 for a motor that turns, and a length in m for a motor that slides
    (`mobee.robot.motor_units.fine_units`).
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array
    fine: Array

    @classmethod
    def of(cls, robot: Robot, part: str) -> Limits:
        """Return the limits of the part's motors in the robot's file."""
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
    """A command to one part, as it arrived in `Command` or `Commands`.

    `src`: sender. `seq`: sequence number of the message. `epoch`: number of the sender's ownership of the part. `re_k`: tick that the
    command answers. `reference`: (n_part,) rad, rad/s or N m, by `mode`. `ttl`: time [ms] from the start of tick `re_k` after which the
    part no longer follows the command. In lockstep (every tick waits for all participants) this time is always 3 ticks (LOCKED_TTL)
    instead.
    """

    src: str
    epoch: int
    seq: int
    re_k: int
    mode: Mode
    reference: Array
    ttl: int

    @classmethod
    def of(cls, command: Command) -> Order:
        """Return the order in a `Command`, the message to one part."""
        return cls(command.src, command.epoch, command.seq, command.re_k, command.mode, np.array(command.ref), command.ttl)


def orders_of(commands: Commands, robot: Robot) -> dict[str, Order]:
    """Return a dict from a part to its order in a `Commands` message; raises KeyError for a part that the robot does not have."""
    reference = np.array(commands.ref)
    src, seq, re_k, ttl = commands.src, commands.seq, commands.re_k, commands.ttl
    return {
        part: Order(src, order.epoch, seq, re_k, order.mode, reference[robot.parts[part].slice], ttl)
        for part, order in commands.parts.items()
    }


@contextmanager
def refused_as_call() -> Iterator[None]:
    """Turn a refusal of the gate (Refused) in the `with` block into a CallRefused with the same reason, for the caller."""
    try:
        yield
    except Refused as refused:
        raise CallRefused(refused.reason, str(refused)) from None


MAX_AGE = 0.1  # s between the tick an order answers and its arrival, in free mode: by the ticks, and by this process's own clock
MAX_TTL = 1000  # ms
POSITION_MARGIN = math.radians(1.0)  # rad by which a position may exceed its limit (encoder noise); it is then clipped
MAX_START = math.radians(2.0)  # rad between the measured position and the first commanded one
MAX_STEP = 2.0  # largest move of a position reference, in distances covered at full speed

_REMEMBERED = 128  # ticks; at the highest rate, 1 kHz, an order may answer one of the last hundred

_EXACT = 1.0 + 1e-9  # factor for rounding: a reference at the limit is within the limit


class Admission:
    """The checks that a command to one part must pass before the part follows it; each check raises Refused with its reason."""

    def __init__(self, part: str, limits: Limits, dt: float, max_ticks: int | None) -> None:
        """Set the limits.

        `dt`: the tick, s. `max_ticks`: in lockstep, the largest age of a command, in ticks since the tick that it answers; None: free mode,
        in which this age is at most MAX_AGE (0.1 s).
        """
        self._part, self._dt, self._max_ticks = part, dt, max_ticks
        self._velocity, self._torque = limits.velocity * _EXACT, limits.torque * _EXACT
        self._margin, self._start = POSITION_MARGIN * limits.fine, MAX_START * limits.fine
        self._lower, self._upper = limits.lower - self._margin, limits.upper + self._margin
        self._stride = MAX_STEP * limits.velocity * dt  # rad a tick
        self._most_strides = max_ticks or max(round(MAX_AGE / dt), 1)

    def check(self, order: Order, k: int) -> None:
        """Raise Refused if an order that arrives in tick k is not valid.

        The method checks that the reference has one value for each motor, that the values are within the limits, that the tick that the
        order answers is neither in the future nor too long ago, and that the ttl is between 1 and 1000 ms.
        """
        reference = order.reference
        if reference.shape != self._lower.shape:
            raise Refused("length", f"{self._part}: {reference.size} numbers for {self._lower.size} motors")
        if not self._is_within(order.mode, reference):  # false for NaN too
            self._refuse(order.mode, reference)
        if order.re_k > k:
            raise Refused("future", f"{self._part}: the command answers tick {order.re_k}, the present tick is {k}")
        self._check_age(k - order.re_k)
        if not 0 < order.ttl <= MAX_TTL:  # 0 must not mean "indefinitely"
            raise Refused("ttl", f"{self._part}: ttl {order.ttl} ms, valid: 1 to {MAX_TTL}")

    def check_step(self, reference: Array, before: Array | None, ticks: int, q: Array) -> None:
        """Raise Refused if a position command is too far from the last one.

        A motor may step by twice its largest velocity times the time since that command, at least one tick and at most 0.1 s (in lockstep:
        at most the largest age of a command). Without a last command, the step is at most 2 degrees (MAX_START).

        Args:
            reference: commanded position, (n_part,) rad.
            before: position that was commanded `ticks` ago, (n_part,) rad; None: there is none, and the measured position is used.
            ticks: number of ticks since `before` was commanded.
            q: measured position, (n_part,) rad.
        """
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
        """Raise Refused for a reference that is not valid; the message gives the defect."""
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
    """Return whether all are true; for few numbers three times as fast as `numpy.all`."""
    return bool(np.count_nonzero(found) == found.size)


class Shaper:
    """Limits the reference positions or velocities of a part by the limits of its motors (position, velocity, acceleration), tick by tick.

    All arrays have the shape (n_part,).
    """

    def __init__(self, limits: Limits, dt: float) -> None:
        self._limits = limits
        self._asked = Braking(limits.lower, limits.upper, limits.velocity, limits.acceleration * dt, dt)

    def start(self, q: Array, velocity: Array) -> None:
        """Begin at the motors' measured positions `q` [rad] and `velocity` [rad/s], (n_part,) each."""
        self._asked.velocity[:] = np.clip(velocity, -self._limits.velocity, self._limits.velocity)
        self._asked.position[:] = q + self._asked.velocity / SERVO_GAIN  # by which the reference leads a servo at that speed

    def to_velocity(self, wanted: Array, q: Array) -> Array:
        """Return the velocity (n_part,) [rad/s] for this tick, as near to `wanted` (n_part,) [rad/s] as the limits allow.

        Near a position limit it is at most the velocity from which the motor can still stop. `q`: measured position, (n_part,) rad.
        """
        self._asked.to_velocity(wanted, q)
        return self._asked.velocity.copy()

    def to_position(self, wanted: Array) -> Array:
        """Advance the commanded position by one tick towards `wanted` (n_part,) [rad], and return it, (n_part,) [rad].

        If `wanted` stays the same in the next ticks, the position comes to rest there.
        """
        self._asked.to_position(wanted)
        return self._asked.position.copy()

    def runs_out(self, q: Array, velocity: Array) -> bool:
        """Return whether a motor is too fast to stop before its position limit.

        A velocity that is too high by less than its largest change in one tick is tolerated. `q` [rad], `velocity` [rad/s]: measured,
        (n_part,) each.
        """
        return self._asked.runs_out(q, velocity)


LOCKED_TTL = 3  # ticks without a new command after which a part holds in lockstep

Report = Callable[[str, str, dict[str, float]], None]  # code, text, values


class Drive(Struct, frozen=True, eq=False):
    """Kind of command (`mode`) and reference of a part's motors in this tick.

    `reference`: (n_part,) rad, rad/s or N m, by mode; None in hold, in which the part brakes and stands still.
    """

    mode: Mode
    reference: Array | None = None


HOLD = Drive("hold")


class InForce(Struct, frozen=True):
    """The command that a part follows at present.

    `expires`: time from which the part no longer follows it (end of its `ttl`), ns of the monotonic clock; not used in lockstep, in which
    every tick waits for all participants.
    """

    order: Order
    expires: int


class Gate:
    """The safety gate of one part, the last check before its motors.

    States: idle (no owner), hold (the part brakes and stands still), armed, fault, estop; the part moves only when armed. Each new owner
    gets a new epoch, a number that its calls and commands must contain. Commands are admitted between ticks; `tick` returns what the motors
    do. The part follows a command until the next one is admitted. If the ttl (lifetime) of the command is over before that, the part brakes
    at full deceleration, holds where it came to rest, and must be armed again.
    """

    def __init__(
        self,
        part: str,
        limits: Limits,
        dt: float,
        epoch: int = 0,
        report: Report | None = None,
        ttl_ticks: int | None = None,
        speed: float = 1.0,
    ) -> None:
        """Begin in the state idle.

        Args:
            part: name of the part, for messages.
            limits: limits of its motors.
            dt: the tick, s.
            epoch: number of the last ownership; every later epoch is larger.
            report: called with code, text and numbers when the part holds, or enters the state estop or fault.
            ttl_ticks: in lockstep, the age [ticks] after which a command is not in force any more; None: free mode, in which the ttl of the
                command counts, in real time from the start of the tick that it answers.
            speed: simulated seconds per second of real time; for a robot in slow motion, times in real time are longer by this factor.
        """
        self.part, self.epoch, self._ttl_ticks = part, epoch, ttl_ticks
        self._stretch = max(1.0, 1.0 / speed)
        self._begun: deque[int] = deque(maxlen=_REMEMBERED)  # ns, monotonic clock: the beginning of the newest ticks
        self.state: GateState = "idle"
        self.owner: tuple[str, str] | None = None  # service, instance of its token
        self.faults = 0
        self.mode: Mode = "hold"  # these three: of the command applied in the present tick
        self.seq = -1
        self.age = -1  # ticks
        self._report = report or (lambda code, text, values: None)
        self._admission = Admission(part, limits, dt, ttl_ticks)
        self._shaper = Shaper(limits, dt)
        self._in_force: InForce | None = None
        self._newest_seq: int  # since the last `take`, without which nothing is admitted
        self._last_position: tuple[Array, int] | None = None  # newest accepted position reference and its tick

    def take(self, who: str, instance: str) -> int:
        """Set a new owner of the part; return the epoch, the number of the new ownership. Later commands of the old owner are refused.

        `who`: name of the owner's service. `instance`: id of its process, as in its liveliness token.
        """
        self.epoch += 1
        self.owner = (who, instance)
        self._newest_seq = -1
        if self.state in ("idle", "armed"):
            self._enter("hold", f"taken by {who}")
        return self.epoch

    def arm(self, epoch: int) -> None:
        """Let the part follow the commands of its owner from now on.

        `epoch`: number of the caller's ownership, which `take` returned. Raises Refused if the part has no owner, if the present ownership
        has another number, or if the state is estop or fault.
        """
        self._check_epoch(epoch)
        if self.state in ("estop", "fault"):
            raise Refused(self.state, f"{self.part} is in {self.state}: {_REMEDY[self.state]}")
        self.state = "armed"

    def release(self, epoch: int) -> None:
        """End the ownership of the part, which then stands still until a client takes and arms it.

        `epoch`: number of the ownership, which `take` returned. Raises Refused if the part has no owner, or if the present ownership has
        another number.
        """
        self._check_epoch(epoch)
        self.owner = None
        if self.state in ("hold", "armed"):
            self._enter("idle", "released")

    def hold(self, epoch: int) -> None:
        """Put the part in hold at the request of its owner: it brakes and stands still, and follows commands again only after `arm`.

        `epoch`: number of the ownership, which `take` returned. Raises Refused if the part has no owner, or if the present ownership has
        another number.
        """
        self._check_epoch(epoch)
        self.force_hold("requested by its owner")

    def force_hold(self, why: str) -> None:
        """Put the part in hold at once, if it is armed, without a request of the owner: it brakes and stands still.

        `why`: reason, for the text that the gate reports.
        """
        if self.state == "armed":
            self._enter("hold", why)

    def lose_owner(self) -> None:
        """End the ownership, because the owner's liveliness token has disappeared; put the part in hold if it is armed.

        In hold the part brakes and stands still.
        """
        who = self.owner[0] if self.owner else "nobody"
        self.owner = None
        self.force_hold(f"its owner {who} is gone")

    def stop(self, why: str) -> None:
        """Enter the state estop (emergency stop), which lasts until `reset_stop`. `why`: reason, for the reported text."""
        if self.state != "estop":
            self._enter("estop", why)

    def reset_stop(self) -> None:
        """End the emergency stop. The part then stands still, in the state hold or fault, and must be armed to move again."""
        if self.state == "estop":
            self._enter("fault" if self.faults else "hold", "emergency stop reset")

    def fail(self, bit: int, why: str) -> None:
        """Record a fault of the part, which only a new run clears.

        `bit`: value of the fault in the bit field `faults`, a power of two. `why`: reason, for the text that the gate reports.
        """
        self.faults |= bit
        if self.state not in ("fault", "estop"):
            self._enter("fault", why)

    def admit(self, order: Order, k: int, now: int, q: Array) -> None:
        """Accept a command (`order`), which the part follows from the next tick on; raise Refused with the reason if it is not admitted.

        `k`: the present tick. `now`: time, ns of the monotonic clock. `q`: measured positions of the part's motors, (n_part,) rad.
        """
        if self.state != "armed":
            raise Refused("not_armed", f"{self.part} is in {self.state}")
        if order.epoch != self.epoch:
            raise Refused("epoch", f"{self.part}: epoch {order.epoch}, in force is {self.epoch}")
        if order.seq <= self._newest_seq:
            raise Refused("seq", f"{self.part}: seq {order.seq} after {self._newest_seq}")
        self._newest_seq = order.seq
        self._admission.check(order, k)
        asked = self._beginning(order.re_k, k, now)
        self._check_delay(now - asked)
        if order.mode == "position":
            before, at = self._last_position or (None, k)
            self._admission.check_step(order.reference, before, k - at, q)
            self._last_position = (order.reference, k)
        else:
            self._last_position = None
        self._in_force = InForce(order, asked + round(order.ttl * 1_000_000 * self._stretch))

    def tick(self, k: int, now: int, q: Array, velocity: Array) -> Drive:
        """Return what the motors do in tick k, which begins now.

        `now`: time, ns of the monotonic clock. `q` [rad], `velocity` [rad/s]: measured, (n_part,) each.
        """
        self._begun.append(now)
        current = self._in_force
        if current is not None and self._has_expired(current, k, now):
            current = None
        if current is None:
            self.mode, self.seq, self.age = "hold", -1, -1
            return HOLD
        order = current.order
        if order.mode != self.mode:
            self._shaper.start(q, velocity)
        self.mode, self.seq, self.age = order.mode, order.seq, k - order.re_k
        return self._shaped(order.mode, order.reference, q, velocity)

    def _beginning(self, re_k: int, k: int, now: int) -> int:
        """Return the time at which tick re_k began, ns; the present tick k is the newest that has begun."""
        ago = k - re_k + 1
        return self._begun[-ago] if ago <= len(self._begun) else now

    def _check_delay(self, delay: int) -> None:
        """Raise Refused if an order (command of a client) comes too late after the tick whose state it was computed from.

        `delay`: time since that tick began [ns]. In lockstep nothing is refused. The age in ticks is not sufficient, because this process
        may have been frozen: then it has made no ticks meanwhile.
        """
        if self._ttl_ticks is None and delay > 1e9 * MAX_AGE * self._stretch:
            raise Refused("age", f"{self.part}: answers a tick that began {delay / 1e6:.0f} ms ago, limit {MAX_AGE * 1e3:.0f} ms")

    def _has_expired(self, current: InForce, k: int, now: int) -> bool:
        """Return whether the command is too old; then the part is put in hold."""
        age, ttl, late = k - current.order.re_k, float(current.order.ttl), (now - current.expires) / 1e6
        if self._ttl_ticks is not None:
            if age > self._ttl_ticks:
                self._enter("hold", f"no valid command for {age} ticks, limit {self._ttl_ticks}", age=float(age))
        elif late > 0:
            self._enter("hold", f"no valid command for {ttl + late:.0f} ms, ttl {ttl:g} ms", late_ms=late, ttl_ms=ttl)
        return self._in_force is None

    def _shaped(self, mode: Mode, reference: Array, q: Array, velocity: Array) -> Drive:
        if mode == "velocity":
            return Drive(mode, self._shaper.to_velocity(reference, q))
        if mode == "position":
            return Drive(mode, self._shaper.to_position(reference))
        if mode == "torque" and self._shaper.runs_out(q, velocity):
            self._enter("hold", "a torque drives a motor into its limit")
            self.mode = "hold"
            return HOLD
        return Drive(mode, reference) if mode == "torque" else HOLD

    def _enter(self, state: GateState, why: str, **values: float) -> None:
        moved, self.state = self.state == "armed", state
        self._forget()
        if moved or state in ("estop", "fault"):
            self._report(state, f"{self.part}: {why}", values)

    def _forget(self) -> None:
        self._in_force = None
        self._last_position = None

    def _check_epoch(self, epoch: int) -> None:
        if self.owner is None or epoch != self.epoch:
            in_force = f"epoch {self.epoch} does" if self.owner else "no client does"
            raise Refused("epoch", f"{self.part}: epoch {epoch} does not own it, {in_force}; take it first")


_REMEDY = {"estop": "reset the emergency stop first", "fault": "reset the simulator"}
