"""The rows of all clauses of a robot, below each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Array, Clause


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
