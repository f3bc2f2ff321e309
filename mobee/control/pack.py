"""A law with its numbers for one robot, as the compiled functions read it (see `layout`)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.control import layout
from mobee.control.gains import Gains
from mobee.control.modality import Modality
from mobee.robot.motor_units import fine_units, limit_zones, motor_units
from mobee.robot.robot import Array, Clause, Robot

INSIDE = 0.999  # of the velocity and acceleration limits, so that no rounding on the way makes the gate refuse
LEASH = 0.3  # s at full speed: how far the position reference may run ahead of a motor that something blocks

Integers = NDArray[np.int64]
_MODALITIES: tuple[Modality, ...] = ("position", "velocity", "torque")


@dataclass(frozen=True, slots=True, eq=False)
class Law:
    """The two flat arrays of `layout`, and the numbers of the settle test."""

    integers: Integers
    floats: Array
    settle: Array  # (5,)


def pack(
    robot: Robot,
    gains: Gains,
    modality: Modality = "velocity",
    speed_scale: float = 1.0,
    contact_forces: bool = True,
    alive: NDArray[np.bool_] | None = None,
) -> Law:
    """Pack what eq. 5.7 needs; bare numbers, all of them checked before.

    `alive` (n,): motors that there are forces for; the others are never moved, as those of weight 0.
    """
    live = np.ones(len(robot.motor_table), dtype=bool) if alive is None else alive
    header = np.zeros(layout.HEADER, dtype=np.int64)
    active, felt = np.flatnonzero(live & (gains.weight(robot.motors) > 0)), np.flatnonzero(live)
    parts = [(p.start, p.start + len(p)) for p in robot.parts.values() if live[p.slice].any()]
    clauses = [clause for clause in robot.clauses if clause.a[:, live].any()]
    firsts, starts, motors, rows, entries = _clauses(clauses, gains, motor_units(robot))
    header[: layout.I_ACTIVE] = (
        len(live),
        len(active),
        len(felt),
        len(clauses),
        len(parts),
        gains.law == "published_2014",
        _MODALITIES.index(modality),
        contact_forces,
        gains.client_squash == "direction",
    )
    whole = [header]
    for slot, table in enumerate((active, felt, firsts, starts, motors, parts), start=layout.I_ACTIVE):
        header[slot] = sum(map(len, whole))
        whole.append(np.asarray(table, dtype=np.int64).ravel())
    shared = [gains.max_constraint, gains.contact_gain, gains.contact_slope, gains.max_contact]
    floats = np.concatenate([shared, _motors(robot, gains, speed_scale).ravel(), rows, entries])
    return Law(np.concatenate(whole), floats, gains.settle.numbers)


def _motors(robot: Robot, gains: Gains, speed_scale: float) -> Array:
    """A row for each motor, (n, MOTOR)."""
    table = np.zeros((len(robot.motor_table), layout.MOTOR))
    table[:, [layout.LOW, layout.HIGH]] = robot.limits
    for column, name in (
        (layout.STIFFNESS, "stiffness"),
        (layout.MAX_SPRING, "max_spring"),
        (layout.DAMPING, "damping"),
        (layout.LIMIT_WIDTH, "limit_width"),
        (layout.MAX_LIMIT, "max_limit"),
        (layout.CLIENT_SLOPE, "client_slope"),
        (layout.MAX_CLIENT, "max_client"),
    ):
        table[:, column] = gains.of_robot(name, robot)
    table[:, [layout.BELOW, layout.ABOVE]] = limit_zones(robot, table[:, layout.LIMIT_WIDTH])
    table[:, layout.MAX_SPEED] = INSIDE * speed_scale * np.array([m.max_velocity for m in robot.motor_table])
    table[:, layout.MAX_ACCELERATION] = INSIDE * np.array([m.max_acceleration for m in robot.motor_table])
    table[:, layout.MAX_TORQUE] = [m.max_torque for m in robot.motor_table]
    table[:, layout.REACH] = LEASH * table[:, layout.MAX_SPEED]
    table[:, layout.UNIT] = motor_units(robot)
    table[:, layout.FINE] = fine_units(robot)
    return table


def _clauses(clauses: Sequence[Clause], gains: Gains, units: Array) -> tuple[list[int], list[int], list[int], list[float], list[float]]:
    """Where clauses, their rows and the rows' entries begin, the entries' motors; and the floats of rows and entries."""
    firsts, starts, motors = [0], [0], list[int]()
    rows, entries = list[float](), list[float]()
    for clause in clauses:
        firsts.append(firsts[-1] + len(clause.b))
        for a, b in zip(clause.a, clause.b, strict=True):
            length = float(np.linalg.norm(a * units))
            # The published law's rows are not normalised: its width is in units of a.q + b.
            rows += [float(b), gains.constraint_width * (1.0 if gains.law == "published_2014" else length)]
            for motor in np.flatnonzero(a):
                motors.append(int(motor))
                entries += [float(a[motor]), float(a[motor] * units[motor] / length)]
            starts.append(len(motors))
    return firsts, starts, motors, rows, entries
