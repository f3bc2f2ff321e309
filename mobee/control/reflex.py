# SPDX-License-Identifier: Apache-2.0
"""MoBeE 1.0: a reflex that moves the robot back along its recent poses after a contact (thesis chapter 4).

Meanwhile the client, which is the program that commands the robot otherwise, has no control.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.arrays import Array, is_number
from mobee.control.forces import checked
from mobee.control.law import stack_clauses
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, kw_only=True)
class ReflexSettings:
    """Settings of the reflex; times in s.

    A violation is a contact, a motor beyond its limit, or a broken constraint on several joints. The client is the program that commands
    the robot while the reflex does not. A waypoint is a recorded pose that counts as safe: the client has marked it, or an earlier recovery
    has returned control there.

    Attributes:
        history: total duration of the recorded poses; when it is reached, each new pose replaces the oldest one.
        confirm: how long a violation must last without a break before it counts.
        release: how long a violation must be absent before it counts as over.
        brake: how long the robot brakes before it retraces its poses.
        dead_time: how long the robot waits after retracing, before the pose is checked.
        pace: number of recorded poses that are retraced in each tick.
        must_be_clear: True: return control to the client only at a pose without violations; if a waypoint has a violation, retrace
            further. False: return control at the first waypoint, or at the oldest recorded pose if there is no waypoint.
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
            value = getattr(self, name)
            if not (is_number(value) and 0.0 <= value < math.inf):
                raise InvalidValue(f"reflex {name} {value!r} s: must be a finite time, not negative")
        for name in ("history", "pace"):
            value = getattr(self, name)
            if not (is_number(value) and 0.0 < value < math.inf):
                raise InvalidValue(f"reflex {name} {value!r}: must be finite and above 0")

    @classmethod
    def naive(cls) -> ReflexSettings:
        """Return the settings of thesis 4.1: a violation (such as a contact) counts immediately, and the robot does not brake or wait.

        While the reflex retraces the recorded poses, it returns control to the client (the program that commands the robot) at the first
        waypoint, a pose that was marked as safe, or at the oldest pose, even if this pose has a violation. With these settings, control
        oscillates between the client and the reflex, and recoveries fail (thesis 4.4).
        """
        return cls(confirm=0.0, release=0.0, brake=0.0, dead_time=0.0, must_be_clear=False)


ContactKind = Literal["solid", "field"]
KINDS: tuple[ContactKind, ...] = ("solid", "field")
TOLERANCE = float(np.deg2rad(1.0))  # rad; the safety gate allows the same beyond a limit


@dataclass(frozen=True, slots=True)
class Violation:
    """One reason why a pose is not safe: a contact, a motor beyond its limit, or a clause (a constraint on several joints) that is broken.

    `kind`: "contact", "limit" or "clause". `what`: names of the two volumes of a contact ("first - second"), name of the motor, or part and
    index of the clause. `depth`: depth of a contact in m; distance beyond a limit in rad (m for a motor that slides); for a clause, the
    distance in rad to the nearest position that satisfies it. A clause has one or more rows (a, b); the pose q satisfies it if
    a.q + b > 0 for at least one row.
    """

    kind: Literal["contact", "limit", "clause"]
    what: str
    depth: float


class Watch:
    """Checks poses for violations: contacts, motors beyond their limits, and clauses (constraints on several joints) that do not hold."""

    def __init__(self, robot: Robot, kinds: Sequence[ContactKind] = KINDS, tolerance: float = TOLERANCE) -> None:
        """Prepare the checks for a robot; raises InvalidValue for an argument that is not valid.

        `kinds`: kinds of contacts that count as violations, of "solid" and "field". `tolerance`: rad, how far a pose may be beyond a limit
        or a clause without a violation, because encoders are noisy; for a motor that slides it is multiplied by its
        `mobee.robot.motor_units.fine_units`, also in clauses.
        """
        if unknown := set(kinds) - set(KINDS):
            raise InvalidValue(f"kinds {sorted(unknown)}: contacts are of the kinds {', '.join(KINDS)}")
        if not 0.0 <= tolerance < np.inf:
            raise InvalidValue(f"tolerance {tolerance} rad: must be a finite angle, not negative")
        self._kinds, self._tolerance = frozenset(kinds), tolerance
        self._motors, self._limits, self._units = robot.motors, robot.limits, fine_units(robot)
        self._rows = stack_clauses(robot.clauses, len(robot.motors))
        self._row_tolerances = tolerance * np.linalg.norm(self._rows.a * self._units, axis=1) / self._rows.norms
        self._clauses = [f"{clause.part} clause {i}" for i, clause in enumerate(robot.clauses)]

    def check(self, pose: Pose) -> tuple[Violation, ...]:
        """Return all violations of one pose: contacts (the deepest first), then exceeded limits (in the order of the motors), then clauses.

        A clause is a constraint on several joints; clauses that do not hold are in the order of `robot.clauses`.
        """
        contacts = [Violation("contact", f"{c.first} - {c.second}", float(c.depth)) for c in pose.contacts if c.kind in self._kinds]
        contacts.sort(key=lambda violation: -violation.depth)
        beyond = np.maximum(self._limits[:, 0] - pose.q, pose.q - self._limits[:, 1])
        past = np.flatnonzero(beyond > self._tolerance * self._units)
        limits = [Violation("limit", self._motors[i], float(beyond[i])) for i in past]
        return (*contacts, *limits, *self._broken(pose))

    def _broken(self, pose: Pose) -> list[Violation]:
        """Return the violated clauses (conditions on motor positions): those of whose rows a.q + b > 0 none holds, beyond the tolerance."""
        rows = self._rows
        if not len(rows.b):
            return []
        each = -(rows.a @ pose.q + rows.b) / rows.norms
        lack, beyond = (np.minimum.reduceat(distance, rows.starts) for distance in (each, each - self._row_tolerances))
        return [Violation("clause", self._clauses[i], float(lack[i])) for i in np.flatnonzero(beyond > 0.0)]


State = Literal["forward", "brake", "rewind", "dead", "stuck"]
Outcome = Literal["under way", "waypoint", "end of history", "stuck"]


@dataclass(slots=True)
class Recovery:
    """One recovery by the reflex, in progress or ended: the robot retraces recent poses after a violation.

    `cause`: the violations at the start. `ticks`: duration in ticks. `deepest`: m, largest depth of a contact during the recovery. `again`:
    how often a violation was over and came back. `passed`: number of waypoints (poses that count as safe) at which the recovery continued,
    because the pose had a violation. `outcome`: "under way", or where the recovery ended: "waypoint", "end of history" (the oldest recorded
    pose), or "stuck" (it failed).
    """

    cause: tuple[Violation, ...]
    ticks: int = 0
    deepest: float = 0.0
    again: int = 0
    passed: int = 0
    outcome: Outcome = "under way"


@dataclass(slots=True)
class Counts:
    """Numbers of events since the reflex was created.

    `reflexes`: recoveries begun. `recovered`: recoveries after which control returned to the client, the program that commands the
    robot while the reflex does not. `stuck`: recoveries that failed. `flips`: how often the pose changed between having a violation and
    having none, before the filter (`Debounce`).
    """

    reflexes: int = 0
    recovered: int = 0
    stuck: int = 0
    flips: int = 0


class Debounce:
    """A filter for a signal that is True or False: its output changes after several consecutive inputs have differed from it.

    There is one input in each tick; the constructor's arguments are the numbers of inputs needed for a change to True and to False. The
    reflex uses it to filter whether its pose has a violation (thesis 4.4). `on`: the present output.
    """

    def __init__(self, confirm: int, release: int) -> None:
        """Set after how many equal inputs the output changes: `confirm` ticks to True, `release` ticks to False, at least 1 each."""
        self._needed = {True: max(confirm, 1), False: max(release, 1)}
        self._ticks = 0  # since the raw signal differs
        self.on = False

    def update(self, raw: bool) -> bool:
        """Process `raw`, the input of one tick; return the output of the filter."""
        self._ticks = self._ticks + 1 if raw != self.on else 0
        if self._ticks >= self._needed[raw]:
            self.on, self._ticks = raw, 0
        return self.on


class Reflex:
    """A state machine that decides in each tick whether the client or the reflex commands the robot; the reflex retraces recent poses.

    The client is the program that commands the robot while the reflex does not. State "forward": the client commands, and poses are
    recorded; a violation that has lasted for the time `confirm` of the settings changes the state to "brake". State "brake": the robot
    stops; after the time `brake`, the state changes to "rewind". State "rewind": the target moves back along the recorded poses, to a
    waypoint (a pose that counts as safe, see `mark`) or to the oldest pose; then the state changes to "dead". State "dead": the robot waits
    for the time `dead_time`. Then, if the pose has no violation, or if the setting `must_be_clear` is False, the state changes to
    "forward"; otherwise to "rewind", or to "stuck" if no recorded pose is left. State "stuck" ends when the pose has no violation, or by
    `accept`.
    """

    def __init__(self, settings: ReflexSettings, dt: float, max_velocity: Array) -> None:
        """Start in state "forward" without recorded poses; raises InvalidValue if `dt` or `max_velocity` is not valid.

        `dt`: duration of a tick [s], finite and above 0. `max_velocity`: (n,) rad/s, above 0: largest velocity of each motor's target
        position in state "rewind", in which the target moves back along the recorded poses.
        """
        if not 0.0 < dt < math.inf:
            raise InvalidValue(f"tick of {dt} s: must be a finite time above 0")
        fastest = np.asarray(max_velocity, dtype=float)
        if not (fastest > 0.0).all():
            raise InvalidValue(f"max_velocity {fastest} rad/s: must be above 0 for each motor")
        self.settings, self.counts = settings, Counts()
        self.state: State = "forward"
        self.recovery: Recovery | None = None  # the one in progress, else the last
        self._dt, self._max_step = dt, fastest * dt
        self._history = deque[tuple[Array, bool]](
            maxlen=max(self._ticks(settings.history), 1)
        )  # recent poses, and whether each is a waypoint
        self._debounce = Debounce(self._ticks(settings.confirm), self._ticks(settings.release))
        self._all_clear = Debounce(1, self._ticks(settings.release))
        self._accepted: frozenset[str] = frozenset()
        self._raw = False
        self._left = 0  # ticks left of a state that ends by time
        self._credit = 0.0  # recorded poses that may be retraced now
        self._goal: Array | None = None  # the recorded pose that the target moves to
        self._at_waypoint = False  # whether the goal is a waypoint
        self._target = np.zeros(len(self._max_step))

    @property
    def recorded(self) -> int:
        """The number of recorded poses, which the reflex can retrace."""
        return len(self._history)

    def mark(self) -> bool:
        """Mark the newest recorded pose as a waypoint: a pose that is known to be safe, and at which a recovery may end.

        Return False, and mark nothing, if no pose is recorded, or if the state is not "forward".
        """
        if self.state != "forward" or not self._history:
            return False
        self._history[-1] = self._history[-1][0], True
        return True

    def accept(self, q: Array, violations: Sequence[Violation]) -> None:
        """Change from state "stuck" to "forward" although the pose has violations; in other states nothing happens.

        `q`: (n,) rad, measured pose. `violations`: the violations of this pose. Later calls of `tick` ignore them until no violation of any
        kind has been present for the time `release` of the settings.
        """
        if self.state != "stuck":
            return
        self._accepted = frozenset(violation.what for violation in violations)
        self._all_clear.on, self._debounce.on = True, False
        self._keep_place(q)

    def tick(self, q: Array, violations: Sequence[Violation]) -> Array | None:
        """Advance the state machine by one tick; return the pose that the reflex commands, (n,) rad, or None if the client commands.

        `q`: (n,) rad, measured pose. `violations`: the violations of this pose. The result depends on the state after this tick (see the
        class). "forward": None, because the client commands the robot. "brake": the pose in which braking began. "rewind": the next pose on
        the path back along the recorded poses; in one tick each motor moves at most by `max_velocity` * `dt`. "dead" and "stuck": the
        same pose as in the tick before. Raises InvalidValue if q has another shape or is not finite; then nothing changes.
        """
        q = checked("q", q, len(self._max_step))
        violated, recovery = self._judge(violations), self.recovery
        if self.state == "forward" or recovery is None:
            if not violated:
                if not self._raw:
                    self._history.append((q.copy(), False))
                return None
            recovery = self._begin(q, violations)
        _watch(recovery, violations)
        self._advance(recovery, q, violated)
        return None if self.state == "forward" else self._target.copy()

    def give_up(self) -> None:
        """Change to state "stuck"; call this if the robot does not follow the reflex. Without a recovery in progress nothing happens."""
        if self.state not in ("forward", "stuck") and self.recovery is not None:
            self._end_stuck(self.recovery)

    def _judge(self, violations: Sequence[Violation]) -> bool:
        """Return whether the pose has a violation, filtered over several ticks by `Debounce`.

        The violations that `accept` has accepted are ignored, until there has been no violation at all for the time `release`.
        """
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
        """Make all transitions of this tick."""
        if self.state == "brake" and self._is_over():
            self._target = q.copy()  # no command was given while it braked
            self.state = "rewind"
        if self.state == "rewind" and self._rewind():
            self._enter("dead", self.settings.dead_time)
        if self.state == "dead" and self._is_over():
            self._conclude(recovery, violated)
        if self.state == "stuck" and not violated:
            self._keep_place(q)

    def _rewind(self) -> bool:
        """Move the target back along the history; return True at a pose where retracing may end."""
        self._credit += self.settings.pace
        while self._credit >= 1.0 and self._history and not self._at_waypoint:
            self._goal, self._at_waypoint = self._history.pop()
            self._credit -= 1.0
        may_end = self._at_waypoint or not self._history
        if self._goal is None:
            return may_end
        path = self._goal - self._target
        near = np.abs(path) <= self._max_step
        self._target = np.where(near, self._goal, self._target + path.clip(-self._max_step, self._max_step))
        return may_end and bool(near.all())

    def _conclude(self, recovery: Recovery, violated: bool) -> None:
        """End the dead time: return control to the client, or retrace further."""
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
        """Change to state "forward", so that the client controls the robot again; record the pose q (n,) rad as a waypoint."""
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
