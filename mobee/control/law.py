# SPDX-License-Identifier: Apache-2.0
"""The control law of thesis eq. 5.7 for one robot, with its gains as tables for the core, and the largest time step at which it is stable.

The compiled formulas are in core/law.cpp, the readable ones in `mobee.reference.forces` and `mobee.reference.law`.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core import INTERVAL, Table, address, numbers, view
from mobee._core import law as core
from mobee.arrays import Array, Ints, is_number
from mobee.control.gains import Gains
from mobee.errors import InvalidValue
from mobee.robot.motor_units import fine_units, limit_zones, motor_units
from mobee.robot.robot import Clause, Robot

Modality = Literal["position", "velocity", "torque"]

INSIDE = 0.999  # share of the velocity and acceleration limits, so that no rounding makes the safety gate refuse a command
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a blocked motor
_OF_MOTORS = ("max_spring", "damping", "client_slope", "max_client")

# Model of a motor in torque mode, here and in the simulated motors: inertia * dv/dt = torque - friction * v.
INERTIA = 0.5  # kg m^2
FRICTION = 5.0  # N m s/rad


class Law:
    """The control law of one robot, as tables for the compiled core. Several threads may use it. Its methods do not check arguments."""

    def __init__(
        self,
        robot: Robot,
        gains: Gains,
        modality: Modality = "velocity",
        speed_scale: float = 1.0,
        contact_forces: bool = True,
        alive: NDArray[np.bool_] | None = None,
    ) -> None:
        """Build the tables from a robot and its gains.

        `speed_scale`: fraction of the motors' largest speed that commands may use. `contact_forces` False: f_coll is 0. `alive` (n,): True
        for the motors on which forces act; None: all. The others are never moved, like motors of weight 0.
        """
        mask = np.ones(len(robot.motor_table), dtype=bool) if alive is None else alive
        self.motors = _motors(robot, gains, speed_scale)
        self.active: Ints = np.flatnonzero(mask & (gains.weight(robot.motors) > 0))
        """Indices of the motors that may be moved."""
        self.live: Ints = np.flatnonzero(mask)
        """Indices of the motors on which forces act."""
        self._dead: Ints = np.flatnonzero(~mask)
        spans = ([i for i in range(part.start, part.start + len(part)) if mask[i]] for part in robot.parts.values())
        self.parts = np.array([(of_part[0], of_part[-1] + 1) for of_part in spans if of_part], dtype=INTERVAL)
        clauses = [clause for clause in robot.clauses if clause.a[:, mask].any()]
        self.clauses, self.rows, self.entries = _clauses(clauses, gains, motor_units(robot))
        self._struct = core.Law(
            *(view(table) for table in (self.motors, self.active, self.live, self.parts, self.clauses, self.rows, self.entries)),
            gains.law == "published_2014", contact_forces, gains.client_squash == "direction", core.MODALITIES.index(modality),
            *(getattr(gains, name) for name in core.TERM_GAINS),
            core.Settle(*(getattr(gains.settle, name) for name in core.SETTLE)),
        )  # fmt: skip
        self.address = ctypes.addressof(self._struct)
        """The address of the law in memory, for the core."""
        self._core = core.calls()
        self._still: Table = np.zeros(len(self.motors), dtype=core.STATE)

    def __len__(self) -> int:
        return len(self.motors)

    def forces(self, q: Array, torque: Array, state: Table | None = None) -> Array:
        """Return the constraint forces at q (n,) rad, thesis eqs. 5.11 to 5.17: (3, n) rad/s^2, rows f_lim, f_cst and f_coll.

        If more forces were added to the compiled core, there are more rows, in the order of `mobee._core.law.term_names()`.

        `torque` (n,): the sum over all contacts of fields (volumes that cause repulsive forces) of J^T (depth * normal), m^2/rad, from
        `Pose.projection` or `Pose.projection_of_part`. `state`: the state of the control law before the step; None: at rest.
        """
        found = np.empty((len(core.term_names()), len(self)))
        own = numbers(self._of_live(torque), len(self))
        self._core.forces(self.address, numbers(q, len(self)), own, address(self._still if state is None else state), address(found))
        found[:, self._dead] = 0.0  # a clause also has entries of motors that are not alive
        return found

    def at_rest(self, q: Array) -> Table:
        """Return the state of the control law at rest at the measured q (n,) rad: (n,) structures of the type `mobee._core.law.STATE`."""
        state: Table = np.zeros(len(self), dtype=core.STATE)
        state["reference"] = np.clip(q, self.motors["low"], self.motors["high"])
        state["reference"][self.active] = q[self.active]
        return state

    def add_client(self, f: Array, total: Array) -> None:
        """Bound a force `f` by thesis eqs. 5.8 to 5.10 and add it to `total`, in place; both (n,) rad/s^2.

        `f` is the force of a client, that is, of the program that uses the controller (see `Controller.force`).
        """
        self._core.client(self.address, numbers(self._of_live(f), len(self)), address(total))

    def _of_live(self, f: Array) -> Array:
        """Return f (n,) with 0 for motors that are not alive: the forces of a part are bounded together, and these have no share."""
        if not len(self._dead):
            return f
        own = f.copy()
        own[self._dead] = 0.0
        return own

    def step(self, q: Array, dt: float, attractor: Array, force: Array, state: Table) -> Array:
        """Advance the state by dt [s]; return the commands (3, n): position [rad], velocity [rad/s] and torque [N m].

        `q`: (n,) rad, measured. `attractor`: (n,) rad. `force`: (n,) rad/s^2, the sum of all forces except spring and damping. `state`:
        changed in place.
        """
        n, commands = len(self), np.empty((3, len(self)))
        given = numbers(q, n), dt, numbers(attractor, n), numbers(force, n)
        self._core.step(self.address, *given, address(state), address(commands))
        return commands


def _motors(robot: Robot, gains: Gains, speed_scale: float) -> Table:
    """Return the table with the gains, limits and units of each motor, one row per motor, as the compiled core reads it.

    `speed_scale`: factor on the largest speed of the motors.
    """
    table: Table = np.zeros(len(robot.motor_table), dtype=core.MOTOR_GAINS)
    table["low"], table["high"] = robot.limits.T
    for name in _OF_MOTORS:
        table[name] = gains.of_robot(name, robot)
    width = gains.of_robot("limit_width", robot)
    table["spring_knee"] = table["max_spring"] / gains.of_robot("stiffness", robot)
    table["client_knee"] = table["max_client"] / table["client_slope"]
    table["limit_slope"] = gains.of_robot("max_limit", robot) / width
    table["low_zone"], table["high_zone"] = limit_zones(robot, width).T
    table["max_speed"] = INSIDE * speed_scale * np.array([m.max_velocity for m in robot.motor_table])
    table["max_acceleration"] = INSIDE * np.array([m.max_acceleration for m in robot.motor_table])
    table["max_torque"] = [m.max_torque for m in robot.motor_table]
    table["max_lead"] = LEASH * table["max_speed"]
    table["unit"], table["settle_unit"] = motor_units(robot), fine_units(robot)
    return table


def _clauses(clauses: Sequence[Clause], gains: Gains, units: Array) -> tuple[Table, Table, Table]:
    """Return the tables of clauses, rows and entries that the compiled core reads.

    A clause (condition on motor positions) has one or more rows a.q + b > 0, a row has an entry for each factor of `a` that is not 0. The
    first table has for each clause the interval of its rows in the second, which has for each row the interval of its entries in the third.
    """
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
    """The rows of all clauses of a robot, stacked as matrices.

    A clause is a condition on motor positions: a.q + b > 0 must hold for at least one of its rows (`mobee.robot.robot.Clause`). `a` (rows,
    n) and `b` (rows,) rad; `norms` (rows,): |a|; `normals` (rows, n): a / |a|; `clause` (rows,): index of the clause of each row; `starts`
    (clauses,): index of the first row of each clause.
    """

    a: Array
    b: Array
    normals: Array
    norms: Array
    clause: NDArray[np.intp]
    starts: NDArray[np.intp]


def stack_clauses(clauses: Sequence[Clause], n: int) -> ClauseRows:
    """Return the rows of all clauses (conditions on motor positions) of a robot with n motors as matrices, one below the other."""
    counts = [len(c.b) for c in clauses]
    a = np.concatenate([c.a for c in clauses]) if clauses else np.zeros((0, n))
    b = np.concatenate([c.b for c in clauses]) if clauses else np.zeros(0)
    norms = np.linalg.norm(a, axis=1)
    starts = np.cumsum([0, *counts[:-1]])[: len(counts)].astype(np.intp)
    return ClauseRows(a, b, a / norms[:, None], norms, np.repeat(np.arange(len(counts)), counts), starts)


@dataclass(frozen=True, slots=True, eq=False)
class Command:
    """One command for all motors: position [rad], velocity [rad/s], torque [N m], each (n,) in the order of `robot.motors`.

    The motors follow one of the three: that of the controller's modality, "position", "velocity" or "torque".
    """

    position: Array
    velocity: Array
    torque: Array


@dataclass(frozen=True, slots=True)
class Bound:
    """The largest stable time step of the control law, and the combined motion of motors that becomes unstable first.

    `step`: s. `motor`: name of the motor with the largest share of that motion. `damping` [1/s], `stiffness` [1/s^2]: of the law along
    that motion.
    """

    step: float
    motor: str
    damping: float
    stiffness: float


def largest_step(robot: Robot, gains: Gains) -> float:
    """Return the time step [s] below which the semi-implicit Euler step of the control law is stable; infinite if no motor moves."""
    return stability_bound(robot, gains).step


def require_stable(robot: Robot, gains: Gains, dt: float) -> None:
    """Raise InvalidValue, with motor and violated bound, if the control law is unstable at steps of dt [s], or if dt is not valid."""
    if not (is_number(dt) and 0 < dt < np.inf):
        raise InvalidValue(f"time step {dt!r} s: must be a finite time above 0")
    bound = stability_bound(robot, gains)
    if dt < bound.step:
        return
    c, k = bound.damping, bound.stiffness
    broken = (
        f"damping * dt = {c * dt:.3g}, must be below 2"
        if c * dt >= 2
        else f"stiffness * dt^2 = {k * dt * dt:.3g} with limits and clauses, must be below 4 - 2 damping dt = {4 - 2 * c * dt:.3g}"
    )
    raise InvalidValue(
        f"gains unstable at steps of {dt:.4g} s: at {bound.motor}, {broken}. Use steps below {bound.step:.4g} s or less damping."
    )


@lru_cache(maxsize=8)
def stability_bound(robot: Robot, gains: Gains) -> Bound:
    """Return the largest stable time step for the worst case: all springs have their largest stiffness at the same time.

    The springs pull the motors to the attractor (the goal position), and push them away from the joint limits and into the region allowed
    by the clauses (conditions on motor positions). C is the diagonal damping [1/s] and K the stiffness [1/s^2] of all motors. A step of dt
    is stable while 4 - 2 dt C - dt^2 K is positive definite. So the largest stable step is 1/s, where s is the largest number for which
    4 s^2 - 2 s C - K is singular. Two effects are not included; docs/law.md has numbers for both. Contacts: their stiffness depends on the
    pose and on their number, and their force is bounded. Delays of commands: their effect depends on the motors.
    """
    moved = np.flatnonzero(gains.weight(robot.motors) > 0)
    if not len(moved):
        return Bound(np.inf, "no motor", 0.0, 0.0)
    damping = gains.of_robot("damping", robot)[moved]
    stiffness = _stiffness(robot, gains)[np.ix_(moved, moved)]
    one = np.eye(len(moved))
    values, vectors = np.linalg.eig(np.block([[np.diag(damping) / 2.0, stiffness / 4.0], [one, 0.0 * one]]))
    most = int(values.real.argmax())
    motion = vectors[len(moved) :, most].real
    motion = motion / np.linalg.norm(motion)
    motor = robot.motors[moved[int(np.abs(motion).argmax())]]
    return Bound(float(1.0 / values[most].real), motor, float(damping @ motion**2), float(motion @ stiffness @ motion))


def _stiffness(robot: Robot, gains: Gains) -> Array:
    """Return the largest possible stiffness of all springs together, a symmetric matrix (n, n) in 1/s^2.

    The springs are those of the goal, the limit zones and the clauses (conditions on motor positions); each counts with the largest slope
    of its force. Positions are in the units of `motor_units`.
    """
    single = gains.of_robot("stiffness", robot) + gains.of_robot("max_limit", robot) / gains.of_robot("limit_width", robot)
    rows = stack_clauses([replace(clause, a=clause.a * motor_units(robot)) for clause in robot.clauses], len(robot.motors))
    slope = gains.max_constraint / gains.constraint_width
    if gains.law == "published_2014":
        steep = slope * rows.norms
    else:  # one row sets the size of the push along all rows of a clause: at most sqrt(number of rows) times as stiff as that row
        steep = slope * np.sqrt(np.bincount(rows.clause))[rows.clause] if len(rows.b) else rows.norms
    found: Array = np.diag(single) + (rows.normals.T * steep) @ rows.normals
    return found
