# SPDX-License-Identifier: Apache-2.0
"""Robots and gains drawn at random, with everything that the law uses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mobee.arrays import Array
from mobee.control import Gains
from mobee.robot.robot import Clause, Motor, Part, Robot
from tests.mobee.planar import tree

Rng = np.random.Generator


def drawn_robot(rng: Rng) -> Robot:
    """A tree of joints that turn and slide, in two parts; narrow and wide ranges, homes inside limit zones, clauses."""
    bare = tree(int(rng.integers(10_000)))
    n = len(bare.motors)
    split = int(rng.integers(1, n))
    motors = tuple(drawn_motor(rng, motor, "one" if i < split else "two") for i, motor in enumerate(bare.motor_table))
    parts = {"one": Part("one", bare.motors[:split], 0), "two": Part("two", bare.motors[split:], split)}
    clauses = tuple(drawn_clause(rng, n, "one") for _ in range(int(rng.integers(0, 4))))
    return replace(bare, name="drawn", motor_table=motors, parts=parts, clauses=clauses)


def drawn_motor(rng: Rng, motor: Motor, part: str) -> Motor:
    limits = np.sort(rng.normal(size=2) * 10.0 ** rng.uniform(-1.5, 0.5)) + [-1e-3, 1e-3]
    return replace(
        motor,
        part=part,
        limits=limits,
        home=float(rng.uniform(*limits)),
        max_velocity=float(rng.uniform(0.1, 3.0)),
        max_acceleration=float(rng.uniform(1.0, 30.0)),
        max_torque=float(rng.uniform(0.5, 40.0)),
        zone_ends_at_home=bool(rng.random() < 0.3),
    )


def drawn_clause(rng: Rng, n: int, part: str) -> Clause:
    rows = int(rng.integers(1, 4))
    a = rng.normal(size=(rows, n)) * (rng.random((rows, n)) < 0.3)
    a[:, int(rng.integers(n))] += 1.0
    return Clause(part, a, rng.normal(size=rows))


def drawn_gains(rng: Rng) -> Gains:
    """Either law, with gains of single motors, one of them never moved at times, and either squash of a client's forces."""
    gains = Gains.published_2014() if rng.random() < 0.5 else Gains.default()
    gains = replace(gains, client_squash="each" if rng.random() < 0.5 else "direction")
    gains = gains.with_motors("m1*", stiffness=float(rng.uniform(20, 200)), max_client=float(rng.uniform(1, 30)))
    return gains.with_motors("m3", limit_width=float(rng.uniform(0.01, 0.5)), weight=int(rng.integers(2)))


def drawn_pose(rng: Rng, robot: Robot, beyond: float = 0.1) -> Array:
    """A pose, at times a little outside the limits."""
    low, high = robot.limits.T
    return rng.uniform(low - beyond * (high - low), high + beyond * (high - low))


def apart(found: Array, expected: Array) -> float:
    """How far two arrays are apart, in units of the largest number expected, at least 1."""
    return float(np.abs(np.asarray(found) - expected).max(initial=0.0) / max(1.0, np.abs(expected).max(initial=0.0)))
