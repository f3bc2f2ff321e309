"""The nearest that a marker can come to a place, by least squares from many poses: no planner, no law, kinematics alone.

Other than `mobee.reachable`, which is for a glance, it keeps the clauses and moves the named motors alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from mobee import Model
from mobee.robot.robot import Array, Clause

RESTARTS = 16
STEPS = 200
SLACK = 1e-6  # rad: how far below 0 a clause may end


@dataclass(frozen=True, slots=True, eq=False)
class Nearest:
    """The pose (n,) rad that brings the marker nearest, and how far from the place it is then, m."""

    q: Array
    distance: float


def nearest_pose(
    model: Model, marker: str, place: Array, joints: Sequence[str], restarts: int = RESTARTS, seed: int = 0, good: float = 1e-5
) -> Nearest:
    """The best of the least squares solutions from random poses; it stops at the first that is `good` m from the place.

    The named motors move, the others are at home; limits and the clauses of their part hold.  Place (3,) m, root frame.
    """
    robot = model.robot
    columns = np.array([robot.motor_index(name) for name in joints])
    low, high = robot.limits[columns].T
    clauses = [clause for clause in robot.clauses if clause.part == robot.motor_table[columns[0]].part]
    rng = np.random.default_rng(seed)
    best = Nearest(robot.home, np.inf)
    for _ in range(restarts):
        found = minimize(
            _error,
            rng.uniform(low, high),
            (model, marker, place, columns),
            method="SLSQP",
            jac=True,
            bounds=list(zip(low, high, strict=True)),
            constraints={"type": "ineq", "fun": _clearance, "args": (robot.home, columns, clauses)} if clauses else (),
            options={"maxiter": STEPS, "ftol": 1e-12},
        )
        if clauses and _clearance(found.x, robot.home, columns, clauses).min() < -SLACK:
            continue
        distance = float(np.sqrt(2.0 * found.fun))
        if distance < best.distance:
            best = Nearest(_whole(found.x, robot.home, columns), distance)
        if best.distance <= good:
            break
    return best


def _error(q: Array, model: Model, marker: str, place: Array, columns: Array) -> tuple[float, Array]:
    """Half the squared distance, and its gradient."""
    whole = _whole(q, model.robot.home, columns)
    error = model.evaluate(whole).position(marker) - place
    return 0.5 * float(error @ error), model.jacobian(whole, marker)[:3, columns].T @ error


def _clearance(q: Array, home: Array, columns: Array, clauses: Sequence[Clause]) -> Array:
    """The largest row of each clause: a clause holds where it is above 0."""
    whole = _whole(q, home, columns)
    return np.array([(clause.a @ whole + clause.b).max() for clause in clauses])


def _whole(q: Array, home: Array, columns: Array) -> Array:
    whole = home.copy()
    whole[columns] = q
    return whole
