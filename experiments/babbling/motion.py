"""How the robot moved: beyond its limits, how far, how smoothly."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array


def beyond_limits(q: Array, limits: Array) -> Array:
    """The furthest that each motor was beyond its limits, (m,) rad, negative inside; q (ticks, m), limits (m, 2) rad."""
    worst: Array = np.maximum(limits[:, 0] - q.min(axis=0), q.max(axis=0) - limits[:, 1])
    return worst


def path_length(q: Array) -> float:
    """The sum of what all motors went, rad; q (ticks, m)."""
    return float(np.abs(np.diff(q, axis=0)).sum())


def speed(q: Array, dt: float) -> Array:
    """First difference of q (ticks, m) rad over dt [s], (ticks - 1, m) rad/s."""
    first: Array = np.diff(q, axis=0) / dt
    return first


def jerk(q: Array, dt: float) -> Array:
    """Third difference of q (ticks, m) rad over dt [s] cubed, (ticks - 3, m) rad/s^3."""
    third: Array = np.diff(q, n=3, axis=0) / dt**3
    return third
