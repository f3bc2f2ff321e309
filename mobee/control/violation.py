"""What a pose must not be, as the first MoBeE judged it: in contact, beyond a limit, outside a clause (thesis 4.1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.control.clauses import stack_clauses
from mobee.errors import InvalidValue
from mobee.pose import Pose
from mobee.robot.motor_units import fine_units
from mobee.robot.robot import Robot

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
