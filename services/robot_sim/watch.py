# SPDX-License-Identifier: Apache-2.0
"""Measures the physics tick by tick: counts contacts and stops of parts, publishes `sim/truth` (the true state).

With the setting `record` it also writes the true joint positions and the contacts of every tick to files.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bus_schema.messages import ObjectTruth, Truth
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import quaternion_from_matrix
from mobee.model.world import World
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot
from mobee.simulation.motors import Motors
from services.common.bus import Bus
from services.common.rate import Percentiles
from services.robot_sim.gate import Gate
from services.robot_sim.guard import Guard
from services.robot_sim.kinematic import Backend, SolidContact

REST_SPEED = np.deg2rad(1.0)  # rad/s, for slides times `fine_units`; a part whose motors are slower is at rest


@dataclass(slots=True)
class Stops:
    """Statistics of stops: a moving part is put in hold (it brakes and stands still), and comes to rest.

    A stop begins at the last tick in which the part follows a command, and ends when the part is at rest.

    `count`: number of ended stops. `time_max`: largest duration of a stop [s]. `distance_max`: largest motion of a motor in a stop [rad].
    """

    count: int = 0
    time_max: float = 0.0  # s
    distance_max: float = 0.0  # rad
    _commanded: dict[str, tuple[int, Array]] = field(default_factory=dict)  # ns and q at the last tick under command, of parts that moved

    def note_command(self, part: str, now: int, q: Array, moves: bool) -> None:
        """Record that the part follows a command.

        Args:
            part: the part.
            now: time, ns.
            q: measured positions of the part's motors, (n_part,) rad; the array is kept, so the caller must not change it afterwards.
            moves: whether the part moves; if it rests, its record is removed.
        """
        if moves:
            self._commanded[part] = (now, q)
        else:
            self._commanded.pop(part, None)

    def note_hold(self, part: str, now: int, q: Array, moves: bool) -> tuple[float, float] | None:
        """Record that the part is in hold; if it has just come to rest, return time [s] and distance [rad] since its last command.

        Otherwise return None. In hold the part brakes and stands still. `now`: time, ns. `q`: measured positions of the part's motors,
        (n_part,) rad. `moves`: whether the part still moves. The distance is the largest one of the part's motors.
        """
        if moves or part not in self._commanded:
            return None
        start, q_start = self._commanded.pop(part)
        time, distance = (now - start) / 1e9, float(np.abs(q - q_start).max())
        self.count += 1
        self.time_max, self.distance_max = max(self.time_max, time), max(self.distance_max, distance)
        return time, distance

    def forget(self) -> None:
        """Drop the recorded commands; call this when a new run begins."""
        self._commanded.clear()


class Counters:
    """Counts of ticks, commands, contacts and stops since a measurement began."""

    def __init__(self) -> None:
        self.ticks = 0
        self.missed_before = 0  # of Rate, when this measurement began
        self.armed_ticks = 0  # every owned part moves on command
        self.hold_ticks = 0  # at least one owned part holds
        self.ages: Counter[int] = Counter()
        self.deepest = SolidContact()
        self.solid_ticks = 0
        self.gap_min = -1.0
        self.stops = Stops()  # of parts that had to hold
        self.overtime = Percentiles()  # ms, wake-up after the deadline
        self.tick_time = Percentiles()  # ms, gate to end of physics

    def count_gates(self, gates: Iterable[Gate]) -> None:
        """Count the tick, and record the age of the oldest command that a part follows; call this once per tick.

        The age of a command is the number of ticks since the tick from whose state it was computed.
        A part is owned if a process has the right to command it. The tick also counts in `hold_ticks` if at least one owned part follows no
        command (it brakes and stands still), and in `armed_ticks` if there are owned parts and all of them follow commands. `gates`: the
        safety gates of all parts.
        """
        self.ticks += 1
        owned = [gate for gate in gates if gate.state != "idle"]
        ages = [gate.age for gate in owned if gate.mode != "hold"]  # a commanded hold counts as a hold
        if ages:
            self.ages[max(ages)] += 1
        if len(ages) < len(owned):
            self.hold_ticks += 1
        elif ages:
            self.armed_ticks += 1

    def count_contact(self, contact: SolidContact) -> None:
        """Count a tick with a solid contact, and keep the deepest one; `contact`: the deepest contact of the tick."""
        if contact.depth > 0.0:
            self.solid_ticks += 1
        if contact.depth > self.deepest.depth:
            self.deepest = contact

    def count_gap(self, gap: float) -> None:
        """Keep the smallest measured gap [m], the distance of hands and forearms from the obstacles; a negative gap was not measured."""
        if gap >= 0.0 and (gap < self.gap_min or self.gap_min < 0.0):
            self.gap_min = gap

    def age_at(self, percent: float) -> float:
        """Return the percentile `percent` (0 to 100) of the age of commands, in ticks; -1 before the first command.

        The age of a command is the number of ticks since the tick from whose state it was computed. Each tick counts once, with the
        oldest command that a part follows.
        """
        total, seen = sum(self.ages.values()), 0
        for age in sorted(self.ages):
            seen += self.ages[age]
            if seen >= total * percent / 100.0:
                return float(age)
        return -1.0

    def numbers(self, missed: int, pairs_watched: int) -> Mapping[str, float]:
        """Return the counts for `stat`, by name.

        Names with "ticks" are numbers of ticks. "age_...": age of the oldest command [ticks], as `age_at` returns it: ticks since the tick
        from whose state the command was computed. "solid_depth_max" and "gap_min": deepest contact and smallest distance [m]. "stops":
        number of stops, "stop_time_max" and "stop_distance_max": their largest time [s] and distance [rad]. "overtime_ms_...": delay of a
        tick's start after its deadline [ms]. "tick_ms_...": computing time of a tick [ms]. `missed`: number of ticks skipped since the
        start of the process. `pairs_watched`: number of pairs that the simulator tests for contact.
        """
        return {
            "ticks": self.ticks,
            "missed_ticks": missed - self.missed_before,
            "armed_ticks": self.armed_ticks,
            "hold_ticks": self.hold_ticks,
            "age_p50": self.age_at(50),
            "age_p99": self.age_at(99),
            "age_max": max(self.ages, default=-1),
            "solid_depth_max": self.deepest.depth,
            "solid_ticks": self.solid_ticks,
            "pairs_watched": pairs_watched,
            "gap_min": self.gap_min,
            "stops": self.stops.count,
            "stop_time_max": self.stops.time_max,
            "stop_distance_max": self.stops.distance_max,
            "overtime_ms_p50": self.overtime.at(50),
            "overtime_ms_p99": self.overtime.at(99),
            "overtime_ms_max": self.overtime.at(100),
            "tick_ms_p50": self.tick_time.at(50),
            "tick_ms_p99": self.tick_time.at(99),
        }


POSITIONS = "q.f64"  # a row of n float64 [rad] a tick, the first at the end of tick 1
CONTACTS = "contacts.csv"  # tick, pair, depth [m]; nothing for a tick without contact


class Recorded:
    """A back-end (simulator of robot and world) that also records every tick in two files.

    It passes all calls on to another back-end, the recorded one. The files have the true joint positions (n,) rad and the solid contacts of
    every tick. Both files begin anew with every run. Written data are in the files even if the process is killed.
    """

    def __init__(self, inner: Backend, folder: Path) -> None:
        """Open the files in `folder`; raises InvalidValue for a folder that cannot be written. `inner`: the back-end that is recorded."""
        self._inner = inner
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._positions = (folder / POSITIONS).open("wb", buffering=0)
            self._contacts = (folder / CONTACTS).open("w", buffering=1)
        except OSError as error:
            raise InvalidValue(f"record: cannot write {error.filename} ({error.strerror})") from None
        self.name, self.notes, self.pairs_watched = inner.name, inner.notes, inner.pairs_watched
        self._begin()

    @property
    def motors(self) -> Motors:
        """The motors of the recorded back-end."""
        return self._inner.motors

    @property
    def world(self) -> World:
        """The world of the recorded back-end."""
        return self._inner.world

    def step(self, dt: float) -> None:
        """Advance the recorded back-end by a tick of dt [s]; write joint positions and contacts."""
        self._inner.step(dt)
        self._k += 1
        self._positions.write(self._inner.motors.q.tobytes())
        for pair, depth in self._inner.contacts().items():
            self._contacts.write(f"{self._k},{pair},{depth:.6g}\n")

    def reset(self, seed: int) -> None:
        """Put the robot at home and the world in its initial state, and empty the files; `seed`: seed of the encoder noise."""
        self._inner.reset(seed)
        self._begin()

    def place(self, name: str, position: tuple[float, float, float]) -> None:
        """Move a world object of the recorded back-end to a position (x, y, z) m, root frame.

        Raises MobeeError if there is no such object, if it is attached to a link, or if a number is not finite.
        """
        self._inner.place(name, position)

    def contact(self) -> SolidContact:
        """Return the deepest solid contact of the last tick; its depth is 0 if there was none."""
        return self._inner.contact()

    def contacts(self) -> Mapping[str, float]:
        """Return the solid contacts of the last tick: a dict from the names of each pair ("NAME NAME", sorted) to the largest depth [m].

        A solid contact is an overlap of two links, or of a link and an obstacle.
        """
        return self._inner.contacts()

    def gap(self) -> float:
        """Return the present smallest distance of hands and forearms from the obstacles, m, measured by the recorded back-end.

        -1 if there are no obstacles, or if that back-end does not measure the distance.
        """
        return self._inner.gap()

    def _begin(self) -> None:
        self._k = 0
        for file in (self._positions, self._contacts):
            file.seek(0)
            file.truncate()
        self._contacts.write("k,pair,depth\n")


NOT_FINITE = 1  # fault bit


class Watch:
    """Counts contacts, stops and the states of the safety gates in every tick, and publishes the robot's true state (`sim/truth`).

    The safety gate of a part checks each command before its motors.
    """

    def __init__(self, bus: Bus, robot: Robot, backend: Backend, guard: Guard, truth_period: int) -> None:
        """Begin with all counts at 0. `truth_period`: number of ticks between two `sim/truth` messages (true state of the simulation)."""
        self._bus, self._robot, self._backend, self._guard = bus, robot, backend, guard
        self._truth = bus.publisher(Truth)
        self._truth_period = truth_period
        self._rest_speed = REST_SPEED * fine_units(robot)
        self._deepest = SolidContact()  # since the last truth message
        self.counters = Counters()

    def mark(self, missed: int) -> None:
        """Begin a measurement, with all counts at 0.

        `missed`: number of ticks skipped since the start of the process; the measurement counts only ticks that are skipped afterwards.
        """
        self.counters = Counters()
        self.counters.missed_before = missed

    def reset(self) -> None:
        """Discard the stops that have not ended (`Stops`), and the deepest contact since the last `sim/truth` message.

        Call this when a new run begins. The counts of the measurement continue.
        """
        self.counters.stops.forget()
        self._deepest = SolidContact()

    def measure(self) -> None:
        """Count contacts, stops of moving parts, and ticks in each state of the safety gates; call this once per tick, after the physics.

        If the physics gives positions that are not finite, all gates enter the state fault.
        """
        gates = self._guard.gates
        self.counters.count_gates(gates.values())
        contact = self._backend.contact()
        self.counters.count_contact(contact)
        if contact.depth > self._deepest.depth:
            self._deepest = contact
        q = self._backend.motors.q
        if not math.isfinite(q.dot(q)) and not np.isfinite(q).all():  # the first costs a third of the second
            for gate in gates.values():
                gate.fail(NOT_FINITE, "the physics gives NaN or infinite positions")
        self._watch_stops(q)

    def _watch_stops(self, all_q: Array) -> None:
        now, stops = self._bus.t, self.counters.stops
        fast = (np.abs(self._backend.motors.motor_velocities) > self._rest_speed).tolist()
        for part, gate in self._guard.gates.items():
            where = self._robot.parts[part].slice
            q, moves = all_q[where], any(fast[where])
            if gate.mode != "hold":
                stops.note_command(part, now, q, moves)
                continue
            stopped = stops.note_hold(part, now, q, moves)
            if stopped:
                self._bus.event("info", "stopped", f"{part} came to rest", time=stopped[0], distance=stopped[1])

    def publish_truth(self) -> None:
        """Measure the gap to the obstacles, and publish the true state if there is a subscriber.

        The method does both only in every `truth_period`-th tick, otherwise nothing.
        """
        if self._bus.k % self._truth_period:
            return
        gap = self._backend.gap()
        self.counters.count_gap(gap)
        deepest, self._deepest = self._deepest, SolidContact()
        if not self._truth.has_subscribers:
            return
        self._truth.put(
            q=self._backend.motors.q.tolist(),
            depth=deepest.depth,
            pair=deepest.pair,
            gap=gap,
            objects=[
                ObjectTruth(name=thing.name, position=thing.position.tolist(), quaternion=quaternion_from_matrix(thing.rotation).tolist())
                for thing in self._backend.world.objects.values()
            ],
        )
