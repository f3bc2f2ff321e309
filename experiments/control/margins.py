"""How far a posture is beyond the linear constraints and the joint limits; written apart from the law that keeps it inside."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array, Robot


def clause_violations(robot: Robot, q: Array) -> Array:
    """-s/|a| of every clause in the postures q (T, n) rad: (T, clauses) rad along the normal, negative inside.

    s = a.q + b; of a clause of several rows the one that is nearest to being satisfied counts.
    """
    return np.stack([np.min(-(q @ c.a.T + c.b) / np.linalg.norm(c.a, axis=1), axis=1) for c in robot.clauses], axis=1)


def limit_violations(robot: Robot, q: Array) -> Array:
    """How far every motor is beyond the nearer of its limits, (T, n) rad, negative inside."""
    return np.maximum(robot.limits[:, 0] - q, q - robot.limits[:, 1])


def clause_label(robot: Robot, number: int) -> str:
    """A clause in words, its motors without their side."""
    rows = []
    for a, b in zip(robot.clauses[number].a, robot.clauses[number].b, strict=True):
        terms = [f"{a[i]:+.3g} {robot.motors[i].split('_', 1)[1]}" for i in np.flatnonzero(a)]
        rows.append(f"{' '.join(terms)} > {-np.rad2deg(b):.4g}")
    return " or ".join(rows)
