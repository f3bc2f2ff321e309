"""Whether clauses can be satisfied together: a witness is looked for, first among given poses, then by moving them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain, islice, product

import numpy as np

from mobee.control.clauses import stack_clauses
from mobee.robot.robot import Array, Clause

CHOICES = 64  # ways of choosing a row of every clause that are tried, after those that are nearly satisfied
STEPS = 400  # of correction a choice
FIRST = 8  # poses that are corrected
MARGIN = 1e-6  # rad


def conflict(clauses: Sequence[Clause], limits: Array, poses: Array) -> tuple[int, ...]:
    """Indices of a smallest set of clauses that no pose was found to satisfy together; () if all can be.

    `limits` (n, 2) rad, `poses` (k, n) rad within them to begin from.  A witness proves that clauses agree; that none is found proves
    nothing, but the clauses named are then few, and a person sees.
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
    """Clauses in groups that share no motor: only within one can they contradict each other."""
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
    nearest = poses[np.argsort(-best)[:FIRST]]
    likely = (tuple(int((clause.a @ q + clause.b).argmax()) for clause in clauses) for q in nearest)
    every = islice(product(*(range(len(clause.b)) for clause in clauses)), CHOICES)
    return any(_corrected(clauses, choice, limits, nearest) for choice in dict.fromkeys(chain(likely, every)))


def _corrected(clauses: Sequence[Clause], choice: tuple[int, ...], limits: Array, poses: Array) -> bool:
    """Projects the poses onto the chosen rows in turn and back into the limits, until one of them satisfies all."""
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
