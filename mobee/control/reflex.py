"""MoBeE 1.0: switching control and the reflex that retraces the recent poses (thesis chapter 4)."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.control.law import stack_clauses
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflexSettings:
    """Numbers of the reflex; times in s.

    `confirm`: how long a violation must last, in every tick, before it counts; `release`: how long it must be away.
    `brake`: how long the robot brakes before it is rewound; `dead_time`: how long it rests behind the rewinding, before it is judged.
    `pace`: recorded poses that are rewound a tick.  `must_be_clear`: a waypoint that is itself in violation is passed by, and
    control is given back at a clear pose only.
    """

    history: float = 30.0
    confirm: float = 0.03
    release: float = 0.1
    brake: float = 0.1
    dead_time: float = 0.5
    pace: float = 1.0
    must_be_clear: bool = True

    def __post_init__(self) -> None:
        for name in ("confirm", "release", "brake", "dead_time"):
            if not 0.0 <= getattr(self, name) < math.inf:
                raise InvalidValue(f"reflex {name} {getattr(self, name)} s: must be a finite time, not negative")
        for name in ("history", "pace"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise InvalidValue(f"reflex {name} {getattr(self, name)}: must be finite and above 0")

    @classmethod
    def naive(cls) -> ReflexSettings:
        """As chapter 4.1 describes it: the first violation counts, and control goes back where a waypoint is reached.

        4.4 tells what became of that: oscillation between the two controllers, and recoveries that fail.
        """
        return cls(confirm=0.0, release=0.0, brake=0.0, dead_time=0.0, must_be_clear=False)


ContactKind = Literal["solid", "field"]
KINDS: tuple[ContactKind, ...] = ("solid", "field")
TOLERANCE = float(np.deg2rad(1.0))  # rad; the safety gate grants the same beyond a limit


@dataclass(frozen=True, slots=True)
class Violation:
    """One thing that is wrong with a pose."""

    kind: Literal["contact", "limit", "clause"]
    what: str  # "first - second", the motor, or the part and number of the clause
    depth: float  # m of a contact, rad (m of a slide) beyond a limit, rad along the normal of the clause's nearest row


class Watch:
    """Says what is wrong with a pose."""

    def __init__(self, robot: Robot, kinds: Sequence[ContactKind] = KINDS, tolerance: float = TOLERANCE) -> None:
        """`kinds`: of contacts that count; `tolerance` rad by which a limit or a clause may be exceeded: encoders are noisy.

        Of a motor that slides the tolerance counts in its fine unit (`mobee.robot.motor_units`).
        """
        if unknown := set(kinds) - set(KINDS):
            raise InvalidValue(f"kinds {sorted(unknown)}: contacts are of the kinds {', '.join(KINDS)}")
        if not 0.0 <= tolerance < np.inf:
            raise InvalidValue(f"tolerance {tolerance} rad: must be a finite angle, not negative")
        self._kinds, self._tolerance = frozenset(kinds), tolerance
        self._motors, self._limits, self._units = robot.motors, robot.limits, fine_units(robot)
        self._rows = stack_clauses(robot.clauses, len(robot.motors))
        self._clauses = [f"{clause.part} clause {i}" for i, clause in enumerate(robot.clauses)]

    def look(self, pose: Pose) -> tuple[Violation, ...]:
        """Everything that is wrong with one pose: contacts, the deepest first, then limits, then clauses."""
        contacts = [Violation("contact", f"{c.first} - {c.second}", float(c.depth)) for c in pose.contacts if c.kind in self._kinds]
        contacts.sort(key=lambda violation: -violation.depth)
        beyond = np.maximum(self._limits[:, 0] - pose.q, pose.q - self._limits[:, 1])
        past = np.flatnonzero(beyond > self._tolerance * self._units)
        limits = [Violation("limit", self._motors[i], float(beyond[i])) for i in past]
        return (*contacts, *limits, *self._broken(pose))

    def _broken(self, pose: Pose) -> list[Violation]:
        """The clauses none of whose rows is satisfied."""
        rows = self._rows
        if not len(rows.b):
            return []
        lack = np.minimum.reduceat(-(rows.a @ pose.q + rows.b) / rows.norms, rows.starts)
        return [Violation("clause", self._clauses[i], float(lack[i])) for i in np.flatnonzero(lack > self._tolerance)]


State = Literal["forward", "brake", "rewind", "dead", "stuck"]
Outcome = Literal["under way", "waypoint", "end of history", "stuck"]


@dataclass(slots=True)
class Recovery:
    """One reflex, as it stands or as it ended."""

    cause: tuple[Violation, ...]
    ticks: int = 0
    deepest: float = 0.0  # m, of all contacts since it began
    again: int = 0  # how often a violation came back after it was away
    passed: int = 0  # waypoints in violation that were passed by
    outcome: Outcome = "under way"


@dataclass(slots=True)
class Counts:
    """What happened since the reflex was made."""

    reflexes: int = 0
    recovered: int = 0
    stuck: int = 0
    flips: int = 0  # changes of the unfiltered judgement


class Debounce:
    """A signal that changes only after the raw one has said the same for some ticks without a break (thesis 4.4)."""

    def __init__(self, confirm: int, release: int) -> None:
        """Ticks until it becomes true, and until it becomes false; at least 1 each."""
        self._needed = {True: max(confirm, 1), False: max(release, 1)}
        self._ticks = 0  # for which the raw signal has differed
        self.on = False

    def update(self, raw: bool) -> bool:
        """One tick of the raw signal; the filtered one."""
        self._ticks = self._ticks + 1 if raw != self.on else 0
        if self._ticks >= self._needed[raw]:
            self.on, self._ticks = raw, 0
        return self.on


class Reflex:
    """Who commands the robot: the client (state forward), or the reflex, which rewinds the recent poses.

    forward -> brake when a violation is confirmed; brake -> rewind when the time for it is over; rewind -> dead at a waypoint
    or at the end of the history; dead -> forward when the time is over and the pose is clear, else -> rewind to the waypoint
    before, or -> stuck when there is no history left.  stuck -> forward when the pose is clear after all, or by `accept`.
    """

    def __init__(self, settings: ReflexSettings, dt: float, max_velocity: Array) -> None:
        """`dt` s a tick; `max_velocity` (n,) rad/s, beyond which no target of the rewinding moves."""
        if not 0.0 < dt < math.inf:
            raise InvalidValue(f"tick of {dt} s: must be a finite time above 0")
        self.settings, self.counts = settings, Counts()
        self.state: State = "forward"
        self.recovery: Recovery | None = None  # the one under way, else the last
        self._dt, self._max_step = dt, np.asarray(max_velocity, dtype=float) * dt
        self._history = deque[tuple[Array, bool]](maxlen=max(self._ticks(settings.history), 1))  # the newest poses; is it a waypoint
        self._debounce = Debounce(self._ticks(settings.confirm), self._ticks(settings.release))
        self._all_clear = Debounce(1, self._ticks(settings.release))
        self._accepted: frozenset[str] = frozenset()
        self._raw = False
        self._left = 0  # ticks of a state that ends by itself
        self._credit = 0.0  # recorded poses that may be rewound now
        self._goal: Array | None = None  # recorded pose on the way to which the target is
        self._at_waypoint = False  # the goal is one
        self._target = np.zeros(len(self._max_step))

    @property
    def recorded(self) -> int:
        """How many poses could be rewound now."""
        return len(self._history)

    def mark(self) -> bool:
        """A waypoint: the newest recorded pose is safe.  False when nothing is recorded, or the reflex is in control."""
        if self.state != "forward" or not self._history:
            return False
        self._history[-1] = self._history[-1][0], True
        return True

    def accept(self, q: Array, violations: Sequence[Violation]) -> None:
        """Leave `stuck`: somebody answers for the pose q (n,) rad as it is.  What is wrong now counts again once all was clear."""
        if self.state != "stuck":
            return
        self._accepted = frozenset(violation.what for violation in violations)
        self._all_clear.on, self._debounce.on = True, False
        self._keep_place(q)

    def tick(self, q: Array, violations: Sequence[Violation]) -> Array | None:
        """One tick at the measured pose q (n,) rad: the target (n,) rad of the rewinding; None while the client commands.

        While the robot brakes or is stuck, the target is where it shall stay: the pose at which the state began.
        """
        violated, recovery = self._judge(violations), self.recovery
        if self.state == "forward" or recovery is None:
            if not violated:
                if not self._raw:
                    self._history.append((q.copy(), False))
                return None
            recovery = self._begin(q, violations)
        _watch(recovery, violations)
        self._advance(recovery, q, violated)
        return None if self.state == "forward" else self._target

    def give_up(self) -> None:
        """The robot does not obey the reflex: whoever holds it must decide."""
        if self.state not in ("forward", "stuck") and self.recovery is not None:
            self._end_stuck(self.recovery)

    def _judge(self, violations: Sequence[Violation]) -> bool:
        """Whether the pose is in violation, after the filter; what was accepted does not count until all was clear."""
        if self._accepted and not self._all_clear.update(bool(violations)):
            self._accepted = frozenset()
        raw = any(violation.what not in self._accepted for violation in violations)
        self.counts.flips += raw != self._raw
        self._raw, before = raw, self._debounce.on
        violated = self._debounce.update(raw)
        if violated and not before and self.state != "forward" and self.recovery is not None:
            self.recovery.again += 1
        return violated

    def _begin(self, q: Array, violations: Sequence[Violation]) -> Recovery:
        self.recovery = Recovery(tuple(violations))
        self.counts.reflexes += 1
        self._target = q.copy()
        self._goal, self._at_waypoint, self._credit = None, False, 0.0
        self._enter("brake", self.settings.brake)
        return self.recovery

    def _advance(self, recovery: Recovery, q: Array, violated: bool) -> None:
        """Go through the states as far as this tick leads."""
        if self.state == "brake" and self._is_over():
            self._target = q.copy()  # nothing was commanded on the way that braking took
            self.state = "rewind"
        if self.state == "rewind" and self._rewind():
            self._enter("dead", self.settings.dead_time)
        if self.state == "dead" and self._is_over():
            self._conclude(recovery, violated)
        if self.state == "stuck" and not violated:
            self._keep_place(q)

    def _rewind(self) -> bool:
        """Move the target back along the history; True when it is where the rewinding may end."""
        self._credit += self.settings.pace
        while self._credit >= 1.0 and self._history and not self._at_waypoint:
            self._goal, self._at_waypoint = self._history.pop()
            self._credit -= 1.0
        may_end = self._at_waypoint or not self._history
        if self._goal is None:
            return may_end
        way = self._goal - self._target
        near = np.abs(way) <= self._max_step
        self._target = np.where(near, self._goal, self._target + way.clip(-self._max_step, self._max_step))
        return may_end and bool(near.all())

    def _conclude(self, recovery: Recovery, violated: bool) -> None:
        """The robot has rested where the rewinding ended: give control back, or go back further."""
        if not violated or not self.settings.must_be_clear:
            recovery.outcome = "waypoint" if self._at_waypoint else "end of history"
            self.counts.recovered += 1
            self._keep_place(self._target)
        elif self._history:
            recovery.passed += 1
            self._at_waypoint, self._credit = False, 0.0
            self.state = "rewind"
        else:
            self._end_stuck(recovery)

    def _end_stuck(self, recovery: Recovery) -> None:
        recovery.outcome = "stuck"
        self.counts.stuck += 1
        self.state = "stuck"

    def _keep_place(self, q: Array) -> None:
        """Give control back where the robot is; the client's next motion begins there."""
        self._history.append((q.copy(), True))
        self.state = "forward"

    def _enter(self, state: State, duration: float) -> None:
        self.state, self._left = state, self._ticks(duration)

    def _is_over(self) -> bool:
        self._left -= 1
        return self._left < 0

    def _ticks(self, seconds: float) -> int:
        return math.ceil(seconds / self._dt - 1e-9)


def _watch(recovery: Recovery, violations: Sequence[Violation]) -> None:
    recovery.ticks += 1
    recovery.deepest = max([recovery.deepest, *(violation.depth for violation in violations if violation.kind == "contact")])
