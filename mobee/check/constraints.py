# SPDX-License-Identifier: Apache-2.0
"""Checks the clauses of a robot, its conditions on motor positions: contradictions, violations at home, rows without effect."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, islice, product

import numpy as np

from mobee.arrays import Array
from mobee.check.interface import Finding, Subject, some
from mobee.control.gains import Gains
from mobee.control.law import stack_clauses
from mobee.robot.motor_units import in_metres, motor_units
from mobee.robot.robot import Clause

ROUNDING = np.deg2rad(0.01)  # rad: tolerance for the digits of a file


def constraints(subject: Subject) -> Iterator[Finding]:
    """Yield all findings about the robot's clauses (conditions on motor positions)."""
    robot = subject.robot
    dead = False
    for index, clause in enumerate(robot.clauses):
        least, most = row_range(clause, subject.range)
        if most.max() <= 0:
            dead = True
            yield _impossible(subject, index, most)
        else:
            yield from _idle_rows(subject, index, least, most)
        at_home = clause.a @ subject.home + clause.b
        if most.max() > 0 and at_home.max() < -ROUNDING:
            yield _violated_at_home(subject, index)
        elif most.max() > 0:
            yield from _pushed_at_home(subject, index, at_home)
    if not dead:
        yield from _contradiction(subject, robot.clauses)


def row_range(clause: Clause, limits: Array) -> tuple[Array, Array]:
    """Return the smallest and the largest value a.q + b of every row of a clause, each (rows,) rad.

    A clause is a condition on motor positions q: a.q + b > 0 must hold for at least one of its rows. `limits` (n, 2) rad: the range of each
    motor.
    """
    ends = clause.a[:, :, None] * limits[None]
    return ends.min(axis=2).sum(axis=1) + clause.b, ends.max(axis=2).sum(axis=1) + clause.b


def _impossible(subject: Subject, index: int, most: Array) -> Finding:
    return Finding(
        "error",
        "constraint",
        subject.where("clause", str(index)),
        f"{_name(subject, index)} cannot be satisfied within the limits: a.q + b reaches {_text(subject, index, most.max())} at most",
        "the controller would push indefinitely against the limits",
        'check the sign: a row is satisfied when a.q + b > 0, and negate="true" flips it; b is in degrees, or in m for motors in m',
    )


def _violated_at_home(subject: Subject, index: int) -> Finding:
    clause, home = subject.robot.clauses[index], subject.home
    return Finding(
        "warning",
        "constraint",
        subject.where("clause", str(index)),
        f"home violates {_name(subject, index)}: a.q + b is {_text(subject, index, (clause.a @ home + clause.b).max())} there",
        "the controller pushes the robot away from home from the first tick on",
        "move the home or correct the constraint (it is satisfied where a.q + b > 0)",
    )


def _pushed_at_home(subject: Subject, index: int, at_home: Array) -> Iterator[Finding]:
    """Yield a note if no row of a clause holds at home with the margin from which the default gains do not push (`mobee.control.law`).

    `at_home`: (rows,), the value a.q + b of each row at home.
    """
    lengths = np.linalg.norm(subject.robot.clauses[index].a * motor_units(subject.robot), axis=1)
    best, width = int((at_home / lengths).argmax()), Gains.default().constraint_width
    if at_home[best] / lengths[best] < width - ROUNDING:
        yield Finding(
            "note",
            "constraint",
            subject.where("clause", str(index)),
            f"home lies near the boundary of {_name(subject, index)}: a.q + b is {_text(subject, index, at_home[best])} there",
            f"the default gains push where it is below {_text(subject, index, width * lengths[best])}: the robot does not rest at home",
            "nothing, if that is intended; else move the home",
        )


def _idle_rows(subject: Subject, index: int, least: Array, most: Array) -> Iterator[Finding]:
    """Yield a note if a row a.q + b > 0 of a clause (condition on motor positions) holds in every pose, else one for each that never holds.

    `least`, `most`: (rows,) rad, smallest and largest value of a.q + b for each row within the motor limits.
    """
    where, name = subject.where("clause", str(index)), _name(subject, index)
    if least.max() > 0:
        yield Finding(
            "note",
            "constraint",
            where,
            f"{name} is satisfied in every pose within the limits: a.q + b is never below {_text(subject, index, least.max())}",
            "it excludes nothing; at most it pushes near its boundary",
            "remove it, or check sign and unit (degrees, or m for motors in m)",
        )
        return
    for row in np.flatnonzero(most <= 0):
        yield Finding(
            "note",
            "constraint",
            where,
            f"row {row + 1} of {name} is satisfied in no pose within the limits: a.q + b stays below {_text(subject, index, most[row])}",
            "the other rows decide alone",
            "remove the row, or check sign and unit (degrees, or m for motors in m)",
        )


def _contradiction(subject: Subject, clauses: Sequence[Clause]) -> Iterator[Finding]:
    starts = np.concatenate([subject.home[None], subject.samples])
    fighting = conflict(clauses, subject.range, starts)
    if fighting:
        others = ", ".join(subject.where("clause", str(index)) for index in fighting[1:])
        yield Finding(
            "error",
            "constraint",
            subject.where("clause", str(fighting[0])),
            f"{_name(subject, fighting[0])} contradicts {others}: no pose within the limits was found that satisfies them together",
            "in every pose a constraint pushes the robot",
            "check the signs: a row is satisfied when a.q + b > 0; all lists of a part must hold together",
        )


def _name(subject: Subject, index: int) -> str:
    clause = subject.robot.clauses[index]
    motors = [subject.robot.motors[column] for column in np.flatnonzero(clause.a.any(axis=0))]
    return f"the constraint on {some(motors)}"


def _text(subject: Subject, index: int, value: float) -> str:
    """Return a value of a.q + b, or of its change, as text: in degrees, or in m if all motors of the clause are in m."""
    motors = [subject.robot.motor_table[column] for column in np.flatnonzero(subject.robot.clauses[index].a.any(axis=0))]
    return f"{value:.4g} m" if all(in_metres(subject.robot, motor) for motor in motors) else f"{np.rad2deg(value):.4g} deg"


CHOICES = 64  # combinations of one row of each clause that are tried, after those that nearly hold
STEPS = 400  # of correction for each combination
CORRECTED_POSES = 8
MARGIN = 1e-6  # rad


def conflict(clauses: Sequence[Clause], limits: Array, poses: Array) -> tuple[int, ...]:
    """Return the indices of a small set of clauses (conditions on motor positions) that contradict each other; () if none is found.

    The search found no pose that satisfies all clauses of the set, but finds one if any single clause is removed. It may miss a pose that
    exists; the set is small enough for a person to judge. `limits` (n, 2) rad: of the motors. `poses` (k, n) rad: poses within the limits
    from which the search starts.
    """
    for group in _connected(clauses):
        if _satisfiable([clauses[k] for k in group], limits, poses):
            continue
        kept = group
        for index in group:
            fewer = [k for k in kept if k != index]
            if fewer and not _satisfiable([clauses[k] for k in fewer], limits, poses):
                kept = fewer
        return tuple(kept)
    return ()


def _connected(clauses: Sequence[Clause]) -> list[list[int]]:
    """Return groups of clauses that share no motor: only clauses of one group can contradict each other."""
    groups: list[tuple[set[int], list[int]]] = []
    for index, clause in enumerate(clauses):
        motors, members = set(np.flatnonzero(clause.a.any(axis=0)).tolist()), [index]
        for group in [group for group in groups if group[0] & motors]:
            groups.remove(group)
            motors, members = motors | group[0], group[1] + members
        groups.append((motors, sorted(members)))
    return [members for _, members in groups]


def _satisfiable(clauses: Sequence[Clause], limits: Array, poses: Array) -> bool:
    rows = stack_clauses(clauses, poses.shape[1])
    best = np.maximum.reduceat(poses @ rows.a.T + rows.b, rows.starts, axis=1).min(axis=1)
    if best.max() > 0:
        return True
    nearest = poses[np.argsort(-best)[:CORRECTED_POSES]]
    likely = (tuple(int((clause.a @ q + clause.b).argmax()) for clause in clauses) for q in nearest)
    every = islice(product(*(range(len(clause.b)) for clause in clauses)), CHOICES)
    return any(_corrected(clauses, choice, limits, nearest) for choice in dict.fromkeys(chain(likely, every)))


def _corrected(clauses: Sequence[Clause], choice: tuple[int, ...], limits: Array, poses: Array) -> bool:
    """Correct the poses (k, n) rad until one of them satisfies one chosen row of each clause; return whether that succeeds.

    `choice`: for each clause, the index of its row a.q + b > 0. Each of at most 400 steps projects the poses onto the rows, one after the
    other, and then clips them to the `limits` (n, 2) rad.
    """
    a = np.array([clause.a[row] for clause, row in zip(clauses, choice, strict=True)])
    b = np.array([clause.b[row] for clause, row in zip(clauses, choice, strict=True)])
    squares = (a**2).sum(axis=1)
    q = poses.copy()
    for _ in range(STEPS):
        if ((q @ a.T + b) > 0).all(axis=1).any():
            return True
        for row, offset, square in zip(a, b, squares, strict=True):
            lack = np.maximum(MARGIN - (q @ row + offset), 0.0)
            q += (lack / square)[:, None] * row
        q = np.clip(q, limits[:, 0], limits[:, 1])
    return False
