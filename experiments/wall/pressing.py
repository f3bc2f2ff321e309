"""A force that rises in steps, at a hand or at the motors, and how deep it drives the robot into what is in its way."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from experiments.control.depths import deepest, oscillation
from experiments.control.margins import clause_violations, limit_violations
from experiments.control.ride import PERIOD, ride
from experiments.control.row import Row
from mobee import Controller, Gains, Model, load_robot, load_world
from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

LEVELS = (0.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0, 3000.0)  # N/kg at a marker; rad/s^2 at a motor; before the squash
SECONDS, REST = 3.0, 2.0  # a level lasts; its end, in which restlessness is measured
INSIDE = np.deg2rad(1.0)  # of its limits is a motor at home whose limits are watched; some stand at theirs
LOOK = 0.02  # s between two looks for contacts

Push = Callable[[Controller, float], None]


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


def _marker(marker: str, direction: tuple[float, float, float]) -> Push:
    return lambda controller, force: controller.push(marker, force * np.array(direction))


def _both(x: float, y: float, z: float) -> Push:
    """Both hands, mirrored."""

    def push(controller: Controller, force: float) -> None:
        controller.push("left_palm", force * np.array([x, y, z]))
        controller.push("right_palm", force * np.array([x, -y, z]))

    return push


def _motors(part: str, sign: float) -> Push:
    def push(controller: Controller, force: float) -> None:
        f = np.zeros(len(controller.robot.motors))
        f[controller.robot.parts[part].slice] = sign * force
        controller.force(f)

    return push


# Root frame: x backwards, y right, z up.
WALLS: dict[str, Push] = {
    "table, left hand": _marker("left_palm", (0.0, 0.0, -1.0)),
    "table, right hand": _marker("right_palm", (0.0, 0.0, -1.0)),
    "table, both hands": _both(0.0, 0.0, -1.0),
    "table edge": _marker("left_palm", (0.7, 0.0, -0.7)),
    "chest": _marker("left_palm", (1.0, 0.2, 0.0)),
    "the other hand": _both(0.0, 1.0, 0.0),
    "face": _marker("right_palm", (0.7, -0.5, 0.5)),
    "limits, arm +": _motors("left_arm", 1.0),
    "limits, arm -": _motors("left_arm", -1.0),
    "limits, torso +": _motors("torso", 1.0),
    "limits, torso -": _motors("torso", -1.0),
}


@lru_cache(maxsize=1)
def model() -> Model:
    """The iCub at the table."""
    return Model(load_robot("icub"), load_world("table"))


def press(gains: str, wall: str, seed: int) -> Iterator[Pressed]:
    """From home, one level after the other."""
    plant = OfflinePlant(model(), seed, Gains.named(gains), dt=PERIOD[gains])
    robot, step = plant.robot, max(1, round(LOOK / plant.dt))
    free = limit_violations(robot, robot.home[None])[0] < -INSIDE
    for force in LEVELS:
        WALLS[wall](plant.controller, force)
        done = ride(plant, SECONDS)
        depths = deepest(model(), done.q[::step])
        rest = done.last(REST)
        yield Pressed(
            gains,
            wall,
            force,
            1e3 * depths.solid,
            1e3 * depths.field,
            _worst(clause_violations(robot, done.q)),
            _worst(limit_violations(robot, done.q)[:, free]),
            1e3 * max(oscillation(model(), rest, marker) for marker in ("left_palm", "right_palm")),
            1e3 * depths.beside,
            depths.pair,
        )


def _worst(angles: Array) -> float:
    return float(np.rad2deg(angles.max()))
