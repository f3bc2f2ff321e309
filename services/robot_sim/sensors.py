# SPDX-License-Identifier: Apache-2.0
"""The simulated encoders: the times at which each part is sampled, the published states, and the limits of the parts' motors."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from typing import Literal

import numpy as np
from msgspec.structs import replace

from bus_schema import VERSION
from bus_schema.messages import PartStatus, State, Tick
from bus_schema.rpc import PartMeta
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.robot import Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.common.worlds import robot_hash
from services.robot_sim.gate import Gate, Limits

PHASE_RANGE = 0.8  # phases are in the first 80 % of the tick
DRAWN_TICKS = 256  # ticks whose jitter is drawn at once


class Phases:
    """The times within each tick at which the parts are sampled: a fixed phase for each part plus jitter; both are drawn with a seed."""

    def __init__(self, parts: Sequence[str], jitter: float, seed: int) -> None:
        """Draw the fixed phase of each part. `jitter`: standard deviation of the random change of a sampling time, as a share of a tick."""
        self._parts, self._jitter = tuple(parts), jitter
        self._rng = np.random.default_rng([seed, 0x706861])
        self._phases = self._rng.uniform(0.0, PHASE_RANGE, len(parts))
        self._drawn: Iterator[list[float]] = iter(())

    def next(self) -> list[tuple[float, str]]:
        """Return a pair for each part, sorted by time: the share of the next tick (0 to 1) after which it is sampled, and its name."""
        times = next(self._drawn, None)
        if times is None:
            jitter = self._jitter * self._rng.standard_normal((DRAWN_TICKS, len(self._parts)))
            self._drawn = iter(np.clip(self._phases + jitter, 0.0, 0.95).tolist())
            times = next(self._drawn)
        return sorted(zip(times, self._parts, strict=True))


def part_meta(robot: Robot, part: str) -> PartMeta:
    """Return the part's motors and their limits, as the reply to the call `{part}/meta`."""
    limits = Limits.of(robot, part)
    return PartMeta(
        v=VERSION,
        part=part,
        motors=list(robot.part(part).motors),
        lower=limits.lower.tolist(),
        upper=limits.upper.tolist(),
        max_velocity=limits.velocity.tolist(),
        max_acceleration=limits.acceleration.tolist(),
        max_torque=limits.torque.tolist(),
        robot=robot.name,
        robot_hash=robot_hash(robot),
    )


def errors_of(robot: Robot, errors: Mapping[str, float]) -> Array:
    """Return the constant errors of all encoders (n,), rad, or m for motors that slide.

    `errors`: error of an encoder by the name of its motor; the errors of motors that are not named are 0. Raises UnknownName for a name
    that is not a motor, and InvalidValue for an error that is not finite.
    """
    found = np.zeros(len(robot.motors))
    for name, error in errors.items():
        if not np.isfinite(error):
            raise InvalidValue(f"encoder error {error!r} of {name}: give a finite angle [rad], or length [m] for a motor that slides")
        found[robot.motor_index(name)] = error
    return found


class Sensors:
    """The newest sample of every part, and the streams `tick` and `{part}/state` that publish the samples.

    A sample has the encoder positions, velocities and torques of the part's motors at one time.
    """

    def __init__(self, bus: Bus, robot: Robot, dt: float, errors: Array | None = None) -> None:
        """`dt`: the tick, s. `errors`: (n,) rad, constant errors of the encoders, reading minus true position; None: none."""
        self._bus, self._dt = bus, dt
        self._errors = np.zeros(len(robot.motors)) if errors is None else errors
        self._where = {name: part.slice for name, part in robot.parts.items()}
        self._streams = {part: bus.publisher(State, part) for part in robot.parts}
        self._tick = bus.publisher(Tick)
        n = len(robot.motors)
        self._q, self._dq, self._tau = np.zeros(n), np.zeros(n), np.zeros(n)
        self._shares = np.zeros(n)  # of the tick after which each motor was read
        self.reset()

    def reset(self) -> None:
        """Drop all samples (readings of the parts' motors) and the hash; call this at the start of a new run."""
        self._hash = hashlib.sha256()
        self._statuses: dict[str, PartStatus] = {}

    @property
    def hash(self) -> str:
        """SHA-256 of q, dq, mode and state of the safety gate of every part, at every tick from 1 on: equal for two runs with equal states.

        `digest` adds a tick. robot_sim calls it only in lockstep (every tick waits for all participants).
        """
        return self._hash.hexdigest()

    def begin(self, motors: Motors) -> None:
        """Store the motors' positions and velocities at the start of the tick; `sample` interpolates between these and those at its end."""
        self._q_before, self._dq_before = motors.q, motors.motor_velocities

    def sample(self, shares: Sequence[tuple[float, str]], motors: Motors, gates: Mapping[str, Gate]) -> None:
        """Read parts at their times in this tick, by interpolation between its start (`begin`) and its end, with encoder noise.

        `shares`: pairs (share, part): the part is read when this share of the tick (0 to 1) has passed. The velocities have no noise, and
        are those of the motors, on the input side of the backlash. The readings of each part are published on `{part}/state`. `gates`: the
        safety gate of each part, whose state is published, too.
        """
        q, dq, tau = motors.q, motors.motor_velocities, motors.efforts
        noise = motors.encoders(self._bus.k, self._dt) - q + self._errors

        def read(where: slice, share: Array | float) -> None:
            q_before, dq_before = self._q_before[where], self._dq_before[where]
            self._q[where] = q_before + share * (q[where] - q_before) + noise[where]
            self._dq[where] = dq_before + share * (dq[where] - dq_before)
            self._tau[where] = tau[where]

        for share, part in shares:
            self._shares[self._where[part]] = share
        if len(shares) == len(self._where):  # all at once takes a quarter of the time
            read(slice(None), self._shares)
        else:
            for share, part in shares:
                read(self._where[part], share)
        for share, part in shares:
            self._report(part, self._bus.t + round(share * self._dt * 1e9), gates[part])

    def sample_now(self, motors: Motors, gates: Mapping[str, Gate]) -> None:
        """Read all parts at the same time, the beginning of the present tick, and publish the readings on `{part}/state`.

        The encoder positions have noise, except in tick 0, in which the robot does not move yet. `motors`: the simulated motors. `gates`:
        the safety gate of each part, whose state is published, too.
        """
        k = self._bus.k
        self._q = (motors.encoders(k, self._dt) if k else motors.q) + self._errors
        self._dq, self._tau = motors.motor_velocities, motors.efforts
        for part, gate in gates.items():
            self._report(part, self._bus.t, gate)

    def publish(self, mode: Literal["free", "lock", "paused"], dt: int, rate: float) -> None:
        """Publish the message `Tick`, which starts the tick. Before every part has been read since the reset, nothing is published.

        `mode`: free (ticks follow real time), lock (lockstep: each tick waits for all participants) or paused. `dt`: length of the tick,
        ns. `rate`: simulated seconds per second of real time.
        """
        if len(self._statuses) == len(self._where):
            self._tick.put(dt=dt, mode=mode, rate=rate, q=self._q.tolist(), parts=self._statuses)

    def note_hold(self, gates: Mapping[str, Gate]) -> None:
        """Set the present state of each part's safety gate in the part's newest status, without a command: all parts have just been held.

        `gates`: the safety gate of each part.
        """
        for part, status in self._statuses.items():
            gate = gates[part]
            self._statuses[part] = replace(
                status, mode="hold", gate=gate.state, faults=gate.faults, epoch=gate.epoch, cmd_seq=-1, cmd_age=-1
            )

    def digest(self) -> None:
        """Add the samples (readings of the parts' motors) of this tick to the SHA-256 of the run, `hash`."""
        for part, status in self._statuses.items():
            where = self._where[part]
            self._hash.update(self._q[where].tobytes() + self._dq[where].tobytes() + f"{status.mode} {status.gate}".encode())

    def _report(self, part: str, t: int, gate: Gate) -> None:
        self._statuses[part] = PartStatus(self._bus.k, t, gate.mode, gate.state, gate.faults, gate.epoch, gate.seq, gate.age)
        stream = self._streams[part]
        if stream.has_subscribers:
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
