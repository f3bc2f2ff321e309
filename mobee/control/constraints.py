"""Forces of the linear constraints in configuration space (thesis eqs. 5.14-5.17).  Compiled.

A row is satisfied when a.q + b > 0 (the robot files' convention; the thesis prints n.q < b), a clause
when one of its rows is, and a robot wants all of its clauses.
"""

from __future__ import annotations

import math

from mobee.control.layout import (
    CLAUSES,
    ENTRY,
    F_MOTOR,
    FACTOR,
    FELT,
    I_CLAUSE,
    I_ENTRY,
    I_FELT,
    I_ROW,
    MAX_CONSTRAINT,
    MOTOR,
    MOTORS,
    NORMAL,
    OFFSET,
    PUBLISHED,
    ROW,
    UNIT,
    ZONE,
)
from mobee.engine.compiled import inner_exact
from mobee.robot.robot import Array, Ints


@inner_exact
def clause_forces(integers: Ints, floats: Array, q: Array, force: Array) -> None:
    """Add the pushes of all clauses to `force` (n,), which is zero before; in rad/s^2, and of a motor that slides in its UNIT."""
    maximum, published, pushed = floats[MAX_CONSTRAINT], integers[PUBLISHED] == 1, False
    for clause in range(integers[CLAUSES]):
        first, stop = integers[integers[I_CLAUSE] + clause], integers[integers[I_CLAUSE] + clause + 1]
        least = math.inf
        for row in range(first, stop):
            least = min(least, lack(integers, floats, q, row))
        if published and least >= 0.0:
            pushed = True
            for row in range(first, stop):
                push(integers, floats, row, lack(integers, floats, q, row), force)
        elif not published and least > 0.0:
            pushed = True
            for row in range(first, stop):
                push(integers, floats, row, maximum * least, force)
    if pushed and published:
        clip_2014(integers, maximum, force)
    if pushed:
        for k in range(integers[FELT]):
            i = integers[integers[I_FELT] + k]
            force[i] *= floats[F_MOTOR + i * MOTOR + UNIT]


@inner_exact
def lack(integers: Ints, floats: Array, q: Array, row: int) -> float:
    """How much a row lacks of being satisfied with margin: 0 where the zone begins, 1 on the boundary, on beyond it (eq. 5.15)."""
    o = F_MOTOR + integers[MOTORS] * MOTOR
    entries = o + integers[integers[I_CLAUSE] + integers[CLAUSES]] * ROW
    value = 0.0
    for k in range(integers[integers[I_ROW] + row], integers[integers[I_ROW] + row + 1]):
        value += floats[entries + k * ENTRY + FACTOR] * q[integers[integers[I_ENTRY] + k]]
    return 1.0 - (value + floats[o + row * ROW + OFFSET]) / floats[o + row * ROW + ZONE]


@inner_exact
def push(integers: Ints, floats: Array, row: int, size: float, force: Array) -> None:
    """Add a push along the unit normal of a row (eq. 5.15).

    In the default law the row nearest to being satisfied sets the size for all rows of its clause, which keeps the force
    continuous where that row becomes satisfied.
    """
    entries = F_MOTOR + integers[MOTORS] * MOTOR + integers[integers[I_CLAUSE] + integers[CLAUSES]] * ROW
    for k in range(integers[integers[I_ROW] + row], integers[integers[I_ROW] + row + 1]):
        force[integers[integers[I_ENTRY] + k]] += size * floats[entries + k * ENTRY + NORMAL]


@inner_exact
def clip_2014(integers: Ints, maximum: float, force: Array) -> None:
    """The published law: rows not normalised, their sum clipped to +-1 a motor, times `maximum`."""
    for k in range(integers[FELT]):
        i = integers[integers[I_FELT] + k]
        force[i] = maximum * min(max(force[i], -1.0), 1.0)
