"""The control law of eq. 5.7 with its numbers for one robot; core/law.cpp has the formulas."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core import address
from mobee._core import law as core
from mobee._core.tables import INTERVAL, Table, numbers, view
from mobee.arrays import Array, Ints
from mobee.control.gains import Gains
from mobee.robot.motor_units import fine_units, limit_zones, motor_units
from mobee.robot.robot import Clause, Robot

INSIDE = 0.999  # of the velocity and acceleration limits, so that no rounding on the way makes the gate refuse
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a motor that something blocks

_OF_MOTORS = ("max_spring", "damping", "client_slope", "max_client")


class Law:
    """The law as tables with names, made once; bare numbers, all of them checked before.  Several threads may use it at once."""

    def __init__(
        self,
        robot: Robot,
        gains: Gains,
        modality: Modality = "velocity",
        speed_scale: float = 1.0,
        contact_forces: bool = True,
        alive: NDArray[np.bool_] | None = None,
    ) -> None:
        """`alive` (n,): motors that there are forces for; the others are never moved, as those of weight 0."""
        live = np.ones(len(robot.motor_table), dtype=bool) if alive is None else alive
        self.motors = _motors(robot, gains, speed_scale)
        self.active: Ints = np.flatnonzero(live & (gains.weight(robot.motors) > 0))
        """Indices of the motors that are ever moved."""
        self.felt: Ints = np.flatnonzero(live)
        """Indices of the motors on which forces are computed."""
        felt = ([i for i in range(part.start, part.start + len(part)) if live[i]] for part in robot.parts.values())
        self.parts = np.array([(of_part[0], of_part[-1] + 1) for of_part in felt if of_part], dtype=INTERVAL)
        clauses = [clause for clause in robot.clauses if clause.a[:, live].any()]
        self.clauses, self.rows, self.entries = _clauses(clauses, gains, motor_units(robot))
        self._struct = core.Law(
            *(view(table) for table in (self.motors, self.active, self.felt, self.parts, self.clauses, self.rows, self.entries)),
            gains.law == "published_2014", contact_forces, gains.client_squash == "direction", core.MODALITIES.index(modality),
            *(getattr(gains, name) for name in core.TERM_GAINS),
            core.Settle(*(getattr(gains.settle, name) for name in core.SETTLE)),
        )  # fmt: skip
        self.address = ctypes.addressof(self._struct)
        """Where the core finds the law."""
        self._core = core.calls()
        self._still: Table = np.zeros(len(self.motors), dtype=core.STATE)

    def __len__(self) -> int:
        return len(self.motors)

    def forces(self, q: Array, torque: Array, state: Table | None = None) -> Array:
        """The forces that constrain the robot at q, (len(term_names()), n) in rad/s^2.

        `torque` (n,): the sum of J^T (depth * normal) over the contacts of fields, over the whole tree or cut at the parts.  `state`:
        of the law, before the step; None: it is at rest.
        """
        found = np.empty((len(core.term_names()), len(self)))
        given = numbers(q, len(self)), numbers(torque, len(self)), address(self._still if state is None else state)
        self._core.forces(self.address, *given, address(found))
        return found

    def at_rest(self, q: Array) -> Table:
        """The state at rest at the measured q (n,)."""
        state: Table = np.zeros(len(self), dtype=core.STATE)
        state["reference"] = np.clip(q, self.motors["low"], self.motors["high"])
        state["reference"][self.active] = q[self.active]
        return state

    def add_client(self, f: Array, total: Array) -> None:
        """Add L(f), f_config or f_work (eqs. 5.9 and 5.10), to a total, both (n,)."""
        self._core.client(self.address, numbers(f, len(self)), address(total))

    def step(self, q: Array, dt: float, attractor: Array, force: Array, state: Table) -> Array:
        """Advance a state by dt [s] under the sum of all forces (n,); the commands: position, velocity, torque, (3, n)."""
        n, commands = len(self), np.empty((3, len(self)))
        given = numbers(q, n), dt, numbers(attractor, n), numbers(force, n)
        self._core.step(self.address, *given, address(state), address(commands))
        return commands


def _motors(robot: Robot, gains: Gains, speed_scale: float) -> Table:
    """A row for each motor."""
    table: Table = np.zeros(len(robot.motor_table), dtype=core.MOTOR_GAINS)
    table["low"], table["high"] = robot.limits.T
    for name in _OF_MOTORS:
        table[name] = gains.of_robot(name, robot)
    width = gains.of_robot("limit_width", robot)
    table["spring_knee"] = table["max_spring"] / gains.of_robot("stiffness", robot)
    table["client_knee"] = table["max_client"] / table["client_slope"]
    table["limit_slope"] = gains.of_robot("max_limit", robot) / width
    table["below"], table["above"] = limit_zones(robot, width).T
    table["max_speed"] = INSIDE * speed_scale * np.array([m.max_velocity for m in robot.motor_table])
    table["max_acceleration"] = INSIDE * np.array([m.max_acceleration for m in robot.motor_table])
    table["max_torque"] = [m.max_torque for m in robot.motor_table]
    table["leash"] = LEASH * table["max_speed"]
    table["unit"], table["fine"] = motor_units(robot), fine_units(robot)
    return table


def _clauses(clauses: Sequence[Clause], gains: Gains, units: Array) -> tuple[Table, Table, Table]:
    """The clauses, which say where their rows are, which say where their entries are."""
    spans, rows, entries = list[tuple[int, int]](), list[tuple[float, float, tuple[int, int]]](), list[tuple[int, float, float]]()
    for clause in clauses:
        spans.append((len(rows), len(rows) + len(clause.b)))
        for a, b in zip(clause.a, clause.b, strict=True):
            length = float(np.linalg.norm(a * units))
            moved = np.flatnonzero(a)
            # The published law's rows are not normalised: its width is in units of a.q + b.
            zone = gains.constraint_width * (1.0 if gains.law == "published_2014" else length)
            rows.append((float(b), zone, (len(entries), len(entries) + len(moved))))
            entries += [(int(motor), float(a[motor]), float(a[motor] * units[motor] / length)) for motor in moved]
    return np.array(spans, dtype=INTERVAL), np.array(rows, dtype=core.CLAUSE_ROW), np.array(entries, dtype=core.CLAUSE_ENTRY)


@dataclass(frozen=True, slots=True, eq=False)
class ClauseRows:
    """Row i belongs to clause `clause[i]`."""

    a: Array  # (rows, n)
    b: Array  # (rows,) rad
    normals: Array  # (rows, n), a / |a|
    norms: Array  # (rows,)
    clause: NDArray[np.intp]  # (rows,)
    starts: NDArray[np.intp]  # (clauses,) the first row of each


def stack_clauses(clauses: Sequence[Clause], n: int) -> ClauseRows:
    """Put the clauses of a robot with n motors into one matrix."""
    counts = [len(c.b) for c in clauses]
    a = np.concatenate([c.a for c in clauses]) if clauses else np.zeros((0, n))
    b = np.concatenate([c.b for c in clauses]) if clauses else np.zeros(0)
    norms = np.linalg.norm(a, axis=1)
    starts = np.cumsum([0, *counts[:-1]])[: len(counts)].astype(np.intp)
    return ClauseRows(a, b, a / norms[:, None], norms, np.repeat(np.arange(len(counts)), counts), starts)


Modality = Literal["position", "velocity", "torque"]

# What a torque-commanded motor is taken to be, here and in the simulated motors: inertia * dv/dt = torque - friction * v.
INERTIA = 0.5  # kg m^2
FRICTION = 5.0  # N m s/rad


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """What the motors are told: the modality in force says which one counts; each (n,), motor order of the robot."""

    position: Array  # rad
    velocity: Array  # rad/s
    torque: Array  # N m
