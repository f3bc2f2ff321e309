"""Poses of the four joints that learn, in the whole robot, and in which of them the reactive layer would be silent."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from experiments.learning.published import LEFT, robot
from mobee import Gains, Model
from mobee.robot.robot import Array, Clause

PART, JOINTS = "left_arm", len(LEFT)


def columns() -> slice:
    """Where the four joints stand among the robot's motors."""
    first = robot().parts[PART].start
    return slice(first, first + JOINTS)


def arm_clauses() -> list[Clause]:
    """The rows of the shoulder's cables."""
    return [clause for clause in robot().clauses if clause.part == PART]


@cache
def clause_width() -> float:
    """Where the published law begins to push away from a clause, in units of a.q + b."""
    return Gains.published_2014().constraint_width


def whole(q: Array) -> Array:
    """Poses of the four joints (..., 4) as poses of the robot (..., n), else at home; rad."""
    body = robot()
    poses = np.broadcast_to(body.home, (*q.shape[:-1], len(body.home))).copy()
    poses[..., columns()] = q
    return poses


def silent(model: Model, q: Array, clauses: Sequence[Clause]) -> NDArray[np.bool_]:
    """In which of the poses (P, 4) rad neither a field nor one of the clauses exerts a force, by the published law."""
    poses = whole(q)
    good = np.ones(len(poses), dtype=bool)
    good[model.evaluate(poses).table.pose] = False
    for clause in clauses:
        good &= (poses @ clause.a.T + clause.b).max(axis=1) >= clause_width()
    return good
