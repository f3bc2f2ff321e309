"""The safety gate of one part, the last check before its motors, and the shaping of references. Pure logic, time is given."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from msgspec import Struct

from bus_schema import Refused
from bus_schema.messages import GateState, Mode
from mobee.arrays import Array
from mobee.simulation.motors import SERVO_GAIN, Braking
from services.robot_sim.admission import Admission, Limits, Order


class Shaper:
    """Turns commanded references into allowed ones, tick by tick; arrays (n,)."""

    def __init__(self, limits: Limits, dt: float) -> None:
        self._limits = limits
        self._asked = Braking(limits.lower, limits.upper, limits.velocity, limits.acceleration * dt, dt)

    def start(self, q: Array, velocity: Array) -> None:
        """Begin where the motors are, rad, as fast as they are, rad/s."""
        self._asked.velocity[:] = np.clip(velocity, -self._limits.velocity, self._limits.velocity)
        self._asked.position[:] = q + self._asked.velocity / SERVO_GAIN  # so far is the reference ahead of a servo at that speed

    def to_velocity(self, wanted: Array, q: Array) -> Array:
        """The velocity to ask for now; before a position limit no more than can still be braked."""
        self._asked.to_velocity(wanted, q)
        return self._asked.velocity.copy()

    def to_position(self, wanted: Array) -> Array:
        """The position to ask for now, on the way to `wanted` and arriving there at rest."""
        self._asked.to_position(wanted)
        return self._asked.position.copy()

    def runs_out(self, q: Array, velocity: Array) -> bool:
        """Whether some motor is a tick of braking too fast, rad/s, to stop before its position limit."""
        return self._asked.runs_out(q, velocity)


LOCKED_TTL = 3  # ticks after which a part holds in lockstep, where the clock on the wall means nothing

Tell = Callable[[str, str, dict[str, float]], None]  # code, text, values


class Drive(Struct, frozen=True, eq=False):
    """What the motors shall do in this tick; `reference` (n,) rad, rad/s or N m by mode, None on hold."""

    mode: Mode
    reference: Array | None = None


HOLD = Drive("hold")


class InForce(Struct, frozen=True):
    """An accepted command."""

    order: Order
    expires: int  # ns, monotonic clock


class Gate:
    """States: idle (nobody owns the part), hold, armed, fault, estop.  Only `armed` moves.

    Commands are admitted between ticks; `tick` says what the motors shall do.  A command stays in force until the
    next one, or until its ttl; then the part brakes at full deceleration, holds where it came to rest, and must be
    armed again: nothing is ever replayed.
    """

    def __init__(
        self, part: str, limits: Limits, dt: float, epoch: int = 0, tell: Tell | None = None, ttl_ticks: int | None = None
    ) -> None:
        """Idle; `epoch`: every later one is larger.  `tell` hears why a part holds.

        `ttl_ticks`: age [ticks] beyond which no command is in force; None: a command's own ttl, on the clock on the wall.
        """
        self.part, self.epoch, self._ttl_ticks = part, epoch, ttl_ticks
        self.state: GateState = "idle"
        self.owner: tuple[str, str] | None = None  # service, instance of its token
        self.faults = 0
        self.mode: Mode = "hold"  # these three: as applied in the tick that runs
        self.seq = -1
        self.age = -1  # ticks
        self._tell = tell or (lambda code, text, values: None)
        self._admission = Admission(part, limits, dt, ttl_ticks)
        self._shaper = Shaper(limits, dt)
        self._in_force: InForce | None = None
        self._newest_seq = -1
        self._last_position: tuple[Array, int] | None = None  # newest accepted position reference and its tick

    def take(self, who: str, instance: str) -> int:
        """A new owner, a new epoch: whatever the old one still sends is refused."""
        self.epoch += 1
        self.owner = (who, instance)
        self._newest_seq = -1
        if self.state in ("idle", "armed"):
            self._enter("hold", f"taken by {who}")
        return self.epoch

    def arm(self, epoch: int) -> None:
        """Obey commands from now on; raises Refused (epoch, estop, fault)."""
        self._check_epoch(epoch)
        if self.state in ("estop", "fault"):
            raise Refused(self.state, f"{self.part} is in {self.state}: {_REMEDY[self.state]}")
        if self.state != "armed":
            self._forget()
            self.state = "armed"

    def release(self, epoch: int) -> None:
        """Give the part up; raises Refused (epoch)."""
        self._check_epoch(epoch)
        self.owner = None
        if self.state in ("hold", "armed"):
            self._enter("idle", "released")

    def hold(self, epoch: int) -> None:
        """The owner's own wish to hold; raises Refused (epoch)."""
        self._check_epoch(epoch)
        self.force_hold("asked by its owner")

    def force_hold(self, why: str) -> None:
        """Hold at once, whoever owns the part."""
        if self.state == "armed":
            self._enter("hold", why)

    def lose_owner(self) -> None:
        """The owner's token is gone."""
        who = self.owner[0] if self.owner else "nobody"
        self.owner = None
        self.force_hold(f"its owner {who} is gone")

    def stop(self, why: str) -> None:
        """Emergency stop: latched."""
        if self.state != "estop":
            self._enter("estop", why)

    def reset_stop(self) -> None:
        """Unlatch; moving again needs `arm`."""
        if self.state == "estop":
            self._enter("fault" if self.faults else "hold", "emergency stop reset")

    def fail(self, bit: int, why: str) -> None:
        """A fault of the part's hardware; only a new run clears it."""
        self.faults |= bit
        if self.state not in ("fault", "estop"):
            self._enter("fault", why)

    def admit(self, order: Order, k: int, now: int, q: Array) -> None:
        """Put an order in force from the next tick on, or raise Refused with the reason.

        `k`: the tick that runs; `now`: ns, monotonic clock; `q`: (n,) rad measured.
        """
        if self.state != "armed":
            raise Refused("not_armed", f"{self.part} is in {self.state}")
        if order.epoch != self.epoch:
            raise Refused("epoch", f"{self.part}: epoch {order.epoch}, in force is {self.epoch}")
        if order.seq <= self._newest_seq:
            raise Refused("seq", f"{self.part}: seq {order.seq} after {self._newest_seq}")
        self._newest_seq = order.seq
        self._admission.check(order, k)
        if order.mode == "position":
            before, at = self._last_position or (None, k)
            self._admission.check_step(order.reference, before, k - at, q)
            self._last_position = (order.reference, k)
        else:
            self._last_position = None
        self._in_force = InForce(order, now + order.ttl * 1_000_000)

    def tick(self, k: int, now: int, q: Array, velocity: Array) -> Drive:
        """What the motors do in tick k; `q` rad and `velocity` rad/s (n,): where they are."""
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

    def _has_expired(self, current: InForce, k: int, now: int) -> bool:
        """Whether it is too old; then the part holds."""
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
            self._tell(state, f"{self.part}: {why}", values)

    def _forget(self) -> None:
        self._in_force = None
        self._last_position = None

    def _check_epoch(self, epoch: int) -> None:
        if self.owner is None or epoch != self.epoch:
            in_force = f"epoch {self.epoch} does" if self.owner else "nobody does"
            raise Refused("epoch", f"{self.part}: epoch {epoch} does not own it, {in_force}; take it first")


_REMEDY = {"estop": "reset the emergency stop first", "fault": "reset the simulator"}
