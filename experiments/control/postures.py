"""Random postures of some motors, the others at home."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from mobee.robot.robot import Array, Robot


def random_posture(robot: Robot, rng: np.random.Generator, motors: Mapping[str, int], within: tuple[float, float]) -> Array:
    """Of the first so many `motors` of each part, uniform `within` shares of their ranges: (n,) rad."""
    q = robot.home.copy()
    for part, count in motors.items():
        where = slice(robot.parts[part].start, robot.parts[part].start + count)
        low, high = robot.limits[where].T
        q[where] = low + rng.uniform(*within, count) * (high - low)
    return q
