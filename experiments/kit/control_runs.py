"""Runs of the offline plant under the control law, recorded tick by tick, and what all experiments about that law share."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from mobee import Model, load_robot, load_world
from mobee.arrays import Array
from mobee.robot.robot import Robot
from mobee.simulation import OfflinePlant

GAINS = ("default", "published_2014")
PERIOD = {"default": 0.01, "published_2014": 0.02}  # s, the tick at which each set is used
COLORS = {"default": "tab:blue", "published_2014": "tab:orange"}  # of the gain sets, in all figures
CALM = 0.4  # s, for motors with a lag of 50 ms


@lru_cache(maxsize=1)
def icub() -> Model:
    """The iCub alone."""
    return Model(load_robot("icub"))


@lru_cache(maxsize=1)
def icub_at_table() -> Model:
    """The iCub and the table in front of it."""
    return Model(load_robot("icub"), load_world("table"))


@dataclass(frozen=True, slots=True, eq=False)
class PlantRun:
    """T ticks of a plant; row t is the end of tick t."""

    q: Array  # (T, n) rad, where the joints are, not what the encoders say
    velocity: Array  # (T, n) rad/s, commanded
    dt: float  # s

    @property
    def times(self) -> Array:
        """(T,) s from the beginning of the run to the end of each tick."""
        times: Array = self.dt * np.arange(1.0, len(self.q) + 1.0)
        return times

    def last(self, seconds: float) -> PlantRun:
        """The end of the run."""
        count = round(seconds / self.dt)
        return PlantRun(self.q[-count:], self.velocity[-count:], self.dt)


def run_plant(
    plant: OfflinePlant, seconds: float, before: Callable[[int], None] | None = None, at: Collection[int] | None = None
) -> PlantRun:
    """Run the plant, at least one tick; `before` is called ahead of the ticks `at`, of each if None, with the tick's number, from 0."""
    ticks = max(1, round(seconds / plant.dt))
    calls = () if before is None else range(ticks) if at is None else at
    traces = []
    for first, end in pairwise(sorted({0, ticks, *(tick for tick in calls if tick < ticks)})):
        if before is not None and first in calls:
            before(first)
        traces.append(plant.run(end - first))
    return PlantRun(np.concatenate([t.q for t in traces]), np.concatenate([t.velocity for t in traces]), plant.dt)


def place(plant: OfflinePlant, q: Array) -> None:
    """Put a plant at rest at q (n,) rad, its attractor there: the joints are held until the motors have calmed down."""
    plant.controller.reset(q)
    for _ in range(round(CALM / plant.dt)):
        plant.motors.adopt(q)
        plant.tick()
    plant.motors.adopt(q)
    plant.controller.reset(q)


def random_posture(robot: Robot, rng: np.random.Generator, motors: Mapping[str, int], within: tuple[float, float]) -> Array:
    """Of the first so many `motors` of each part, uniform `within` shares of their ranges, the others at home: (n,) rad."""
    q = robot.home.copy()
    for part, count in motors.items():
        where = slice(robot.parts[part].start, robot.parts[part].start + count)
        low, high = robot.limits[where].T
        q[where] = low + rng.uniform(*within, count) * (high - low)
    return q
