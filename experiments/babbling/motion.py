"""How the robot moved: beyond its limits, how far, how smoothly."""

from __future__ import annotations

import numpy as np

from mobee.robot.robot import Array

STILL = 1e-9  # rad/s, a peak speed below it is no motion


def beyond_limits(q: Array, limits: Array) -> Array:
    """The furthest that each motor was beyond its limits, (m,) rad, negative inside; q (ticks, m), limits (m, 2) rad."""
    worst: Array = np.maximum(limits[:, 0] - q.min(axis=0), q.max(axis=0) - limits[:, 1])
    return worst


def path_length(q: Array) -> float:
    """The sum of what all motors went, rad; q (ticks, m)."""
    return float(np.abs(np.diff(q, axis=0)).sum())


def jerk(q: Array, dt: float) -> Array:
    """Third difference of q (ticks, m) rad over dt [s] cubed, (ticks - 3, m) rad/s^3."""
    third: Array = np.diff(q, n=3, axis=0) / dt**3
    return third


def dimensionless_jerk(q: Array, dt: float) -> float | None:
    """Jerk of one motion of all motors, freed of its size and duration, as a natural logarithm; q (ticks, m) rad.

    Integral of the squared jerk, times duration cubed, over the squared peak speed (Hogan and Sternad 2009, "Sensitivity of
    smoothness measures to movement duration, amplitude, and arrests"): ln 205 for a minimum-jerk motion, more for a rougher one.
    None when nothing moved.
    """
    if len(q) < 4:
        return None
    speed = np.linalg.norm(np.diff(q, axis=0), axis=1).max() / dt
    if speed < STILL:
        return None
    duration = (len(q) - 1) * dt
    return float(np.log((jerk(q, dt) ** 2).sum() * dt * duration**3 / speed**2))
