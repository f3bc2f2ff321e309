"""Runs of the offline plant that are looked at tick by tick."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from mobee.robot.robot import Array
from mobee.simulation import OfflinePlant

GAINS = ("default", "published_2014")
CALM = 0.4  # s, for motors with a lag of 50 ms
PERIOD = {"default": 0.01, "published_2014": 0.02}  # s, the tick at which each set is used


@dataclass(frozen=True, slots=True, eq=False)
class Ride:
    """T ticks of a plant; row t is the end of tick t."""

    q: Array  # (T, n) rad, where the joints are, not what the encoders say
    velocity: Array  # (T, n) rad/s, commanded
    dt: float  # s

    @property
    def times(self) -> Array:
        """(T,) s from the beginning of the ride to the end of each tick."""
        times: Array = self.dt * np.arange(1, len(self.q) + 1)
        return times

    def last(self, seconds: float) -> Ride:
        """The end of the ride."""
        count = round(seconds / self.dt)
        return Ride(self.q[-count:], self.velocity[-count:], self.dt)


def ride(plant: OfflinePlant, seconds: float, before: Callable[[int], None] | None = None, at: Collection[int] | None = None) -> Ride:
    """Run the plant, at least one tick; `before` is called ahead of the ticks `at`, of each if None, with the tick's number, from 0."""
    ticks = max(1, round(seconds / plant.dt))
    calls = () if before is None else range(ticks) if at is None else at
    traces = []
    for first, end in pairwise(sorted({0, ticks, *(tick for tick in calls if tick < ticks)})):
        if before is not None and first in calls:
            before(first)
        traces.append(plant.run(end - first))
    return Ride(np.concatenate([t.q for t in traces]), np.concatenate([t.velocity for t in traces]), plant.dt)


def place(plant: OfflinePlant, q: Array) -> None:
    """Put a plant at rest at q (n,) rad, its attractor there: the joints are held until the motors have calmed down."""
    plant.controller.reset(q)
    for _ in range(round(CALM / plant.dt)):
        plant.motors.adopt(q)
        plant.tick()
    plant.motors.adopt(q)
    plant.controller.reset(q)
