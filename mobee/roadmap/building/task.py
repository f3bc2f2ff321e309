"""Task spaces: the coordinates over which a roadmap is spread (thesis eqs. 3.4, 3.5)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.roadmap.ik.term import Aim
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True, eq=False)
class Coordinate:
    """One y_i: a number of a pose, and the range in which it is to be covered.

    `unit`: "m", "rad" or "".  `function`: of a batch of poses q (N, n), (N,).  `aims`: what least squares is to meet for a value; None
    where there is no derivative.  Raises InvalidValue unless low < high.
    """

    name: str
    unit: str
    low: float
    high: float
    function: Callable[[Pose], Array]
    aims: Callable[[Robot, float], tuple[Aim, ...]] | None = None

    def __post_init__(self) -> None:
        if not (math.isfinite(self.low) and math.isfinite(self.high) and self.low < self.high):
            raise InvalidValue(f"box of {self.name!r} is ({self.low}, {self.high}); it must be finite (low, high), low below high.")


@dataclass(frozen=True, slots=True, eq=False)
class Task:
    """A task space Y: its coordinates; `first + second` has those of both."""

    coordinates: tuple[Coordinate, ...]

    def __post_init__(self) -> None:
        if not self.coordinates:
            raise InvalidValue("a task space needs a coordinate at least: see mobee.tasks.")
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice:
            raise InvalidValue(f"the task space has {', '.join(twice)} more than once; every coordinate needs a name of its own.")

    @property
    def names(self) -> tuple[str, ...]:
        """Of the coordinates."""
        return tuple(one.name for one in self.coordinates)

    @property
    def box(self) -> Array:
        """Lowest and highest value of every coordinate, (m, 2) in their units."""
        return np.array([(one.low, one.high) for one in self.coordinates])

    def of(self, pose: Pose) -> Array:
        """The task coordinates of a batch of poses q (N, n), (N, m); raises InvalidValue where one of them is no finite number."""
        y = np.stack([np.asarray(one.function(pose), dtype=np.float64) for one in self.coordinates], axis=-1)
        if not np.isfinite(y).all():
            where = np.argwhere(~np.isfinite(y))[0]
            raise InvalidValue(f"task coordinate {self.names[where[-1]]!r} is {y[tuple(where)]} in a pose; it must be finite in all poses.")
        return y

    def aims(self, robot: Robot, y: Array) -> tuple[Aim, ...] | None:
        """What least squares is to meet for the task coordinates to be y (m,); None where one of them has no derivative."""
        found: list[Aim] = []
        for one, value in zip(self.coordinates, y, strict=True):
            if one.aims is None:
                return None
            found += one.aims(robot, float(value))
        return tuple(found)

    def __add__(self, other: Task) -> Task:
        """The task space with the coordinates of both."""
        return Task((*self.coordinates, *other.coordinates))
