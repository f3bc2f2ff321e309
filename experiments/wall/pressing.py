"""A force that rises in steps, at a hand or at the motors, and how deep it drives the robot into what is in its way."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from experiments.control.depths import deepest, oscillation
from experiments.control.margins import clause_violations, limit_violations
from experiments.control.models import icub_at_table
from experiments.control.ride import PERIOD, ride
from experiments.control.row import Row
from experiments.control.walls import WALLS
from mobee import Gains
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

LEVELS = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)  # N/kg at a marker; rad/s^2 at a motor; before the squash
SECONDS, REST = 3.0, 2.0  # a level lasts; its end, in which restlessness is measured
INSIDE = np.deg2rad(1.0)  # of its limits is a motor at home whose limits are watched; some stand at theirs
LOOK = 0.02  # s between two looks for contacts


@dataclass(frozen=True, slots=True)
class Pressed(Row):
    """A level of force and the worst while it lasted; angles are negative inside."""

    gains: str
    wall: str
    force: float
    solid_mm: float
    field_mm: float
    clause_deg: float
    limit_deg: float
    restless_mm: float
    beside_mm: float  # solids that do not count
    pair: str  # of solids, the deepest


def press(gains: str, wall: str, seed: int) -> Iterator[Pressed]:
    """From home, one level after the other."""
    plant = OfflinePlant(icub_at_table(), seed, Gains.named(gains), dt=PERIOD[gains])
    robot, step = plant.robot, max(1, round(LOOK / plant.dt))
    free = limit_violations(robot, robot.home[None])[0] < -INSIDE
    for force in LEVELS:
        WALLS[wall](plant.controller, force)
        done = ride(plant, SECONDS)
        depths = deepest(icub_at_table(), done.q[::step])
        rest = done.last(REST)
        yield Pressed(
            gains,
            wall,
            force,
            1e3 * depths.solid,
            1e3 * depths.field,
            _worst(clause_violations(robot, done.q)),
            _worst(limit_violations(robot, done.q)[:, free]),
            1e3 * max(oscillation(icub_at_table(), rest, marker) for marker in ("left_palm", "right_palm")),
            1e3 * depths.beside,
            depths.pair,
        )


def _worst(angles: Array) -> float:
    return float(np.rad2deg(angles.max()))
