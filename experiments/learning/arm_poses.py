"""Poses of the four joints that learn, in the whole robot, and which of them are clear of contacts and cables."""

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
def least_margin() -> float:
    """How far a clause must be for a pose to count as clear, in units of a.q + b: half the zone in which the published law pushes.

    There the push moves a resting arm by some three degrees, a quarter of the way out of a cell of the rank 3 lattice.
    """
    return Gains.published_2014().constraint_width / 2.0


def whole(q: Array) -> Array:
    """Poses of the four joints (..., 4) as poses of the robot (..., n), else at home; rad."""
    body = robot()
    poses = np.broadcast_to(body.home, (*q.shape[:-1], len(body.home))).copy()
    poses[..., columns()] = q
    return poses


def clear(model: Model, q: Array, clauses: Sequence[Clause]) -> NDArray[np.bool_]:
    """In which of the poses (P, 4) rad no field touches anything and all of the clauses are far enough."""
    poses = whole(q)
    good = np.ones(len(poses), dtype=bool)
    good[model.evaluate(poses).table.pose] = False
    for clause in clauses:
        good &= (poses @ clause.a.T + clause.b).max(axis=1) >= least_margin()
    return good
