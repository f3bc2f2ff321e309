"""Forces of the linear constraints in configuration space (thesis eqs. 5.14-5.17).

A row is satisfied when a.q + b > 0 (the robot files' convention; the thesis prints n.q < b), a clause
when one of its rows is, and a robot wants all of its clauses.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Array, Clause


@dataclass(frozen=True, slots=True, eq=False)
class ClauseRows:
    """The rows of all clauses below each other: row i belongs to clause `clause[i]`."""

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


def clause_forces(rows: ClauseRows, q: Array, width: float, maximum: float) -> Array:
    """The default law: a clause pushes only while none of its rows is satisfied by more than `width`.

    The push grows linearly to `maximum` at the boundary of the clause and on beyond it, along the unit
    normal of each of its rows.  `q` (n,) rad, `width` rad along the normal, result (n,) in rad/s^2.  The row that is
    nearest to being satisfied sets the size for all rows of its clause, which keeps the force continuous
    where that row becomes satisfied.
    """
    if not len(rows.b):
        return np.zeros(rows.a.shape[1])
    lack = 1.0 - (rows.a @ q + rows.b) / (rows.norms * width)
    push: Array = maximum * np.maximum(np.minimum.reduceat(lack, rows.starts), 0.0)
    return push[rows.clause] @ rows.normals


def clause_forces_2014(rows: ClauseRows, q: Array, width: float, maximum: float) -> Array:
    """The published law: rows not normalised, the sum clipped to +-1 a motor, times `maximum`.

    `width` is in units of a.q + b: for the shoulder rows 40 degrees are 13.5 to 28 degrees along the normal.
    Result (n,) in rad/s^2.
    """
    if not len(rows.b):
        return np.zeros(rows.a.shape[1])
    lack = 1.0 - (rows.a @ q + rows.b) / width
    pushes = np.minimum.reduceat(lack, rows.starts) >= 0.0
    return maximum * np.clip(np.where(pushes[rows.clause], lack, 0.0) @ rows.normals, -1.0, 1.0)
