"""Counts since `mark`: age of commands, holds, contacts, times, and how fast held parts stop."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from mobee.arrays import Array
from services.common.rate import Percentiles
from services.robot_sim.gate import Gate
from services.robot_sim.kinematic import SolidContact

MOVING = np.deg2rad(1.0)  # rad/s, below it a part is at rest


@dataclass(slots=True)
class Stops:
    """The stop that each part is in, and the worst of those that ended."""

    count: int = 0
    time_max: float = 0.0  # s
    distance_max: float = 0.0  # rad
    _commanded: dict[str, tuple[int, Array]] = field(default_factory=dict)  # ns and q at the last tick under command, of parts that moved

    def obeys(self, part: str, now: int, q: Array, moves: bool) -> None:
        """The part follows a command now [ns], at q (n,) rad, which nobody changes; `moves`: some motor is faster than MOVING."""
        if moves:
            self._commanded[part] = (now, q)
        else:
            self._commanded.pop(part, None)

    def look(self, part: str, now: int, q: Array, moves: bool) -> tuple[float, float] | None:
        """(time [s], distance [rad]) since the last command, once, when the part has come to rest just now."""
        if moves or part not in self._commanded:
            return None
        start, q_start = self._commanded.pop(part)
        time, distance = (now - start) / 1e9, float(np.abs(q - q_start).max())
        self.count += 1
        self.time_max, self.distance_max = max(self.time_max, time), max(self.distance_max, distance)
        return time, distance

    def forget(self) -> None:
        """A new run."""
        self._commanded.clear()


class Counters:
    """One instance a measurement; the ages count the oldest command of each tick, so no part hides behind another."""

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
        """Once a tick: ages and holds."""
        self.ticks += 1
        owned = [gate for gate in gates if gate.state != "idle"]
        ages = [gate.age for gate in owned if gate.mode != "hold"]  # a hold that is commanded is a hold too
        if ages:
            self.ages[max(ages)] += 1
        if len(ages) < len(owned):
            self.hold_ticks += 1
        elif ages:
            self.armed_ticks += 1

    def count_contact(self, contact: SolidContact) -> None:
        """Once a tick."""
        if contact.depth > 0.0:
            self.solid_ticks += 1
        if contact.depth > self.deepest.depth:
            self.deepest = contact

    def count_gap(self, gap: float) -> None:
        """Whenever it was measured, m."""
        if gap >= 0.0 and (gap < self.gap_min or self.gap_min < 0.0):
            self.gap_min = gap

    def age_at(self, percent: float) -> float:
        """Percentile of the age in ticks, -1 before the first command."""
        total, seen = sum(self.ages.values()), 0
        for age in sorted(self.ages):
            seen += self.ages[age]
            if seen >= total * percent / 100.0:
                return float(age)
        return -1.0

    def numbers(self, missed: int, pairs_watched: int) -> Mapping[str, float]:
        """For `stat`; `missed`: ticks skipped since the start of the process."""
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
