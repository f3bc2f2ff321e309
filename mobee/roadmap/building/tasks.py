# SPDX-License-Identifier: Apache-2.0
"""Task spaces: the coordinates over which a roadmap is spread (thesis eqs. 3.4, 3.5, table 3.2).

Positions are in m in the root frame, angles in rad.  `+` joins task spaces: `place(...) + motors(...)` is the last row of the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.roadmap.ik.costs import unit_vector, vector
from mobee.roadmap.ik.terms import Aim, Function, directed, level, motor_at
from mobee.robot.robot import Robot

AXES = "xyz"
Range = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Coordinate:
    """One task coordinate y_i: a number computed from a pose, and the range that the roadmap covers.

    `low`, `high`: the range, in `unit`. `unit`: that of the coordinate, "m", "rad" or "" (no unit); "rad" of a motor that slides means m.
    `function`: computes the coordinate (N,) of a batch of poses q (N, n). `aims`: function of the robot and a value; it returns residuals
    of type `Aim` for least squares. If these are 0 in a pose, the coordinate has this value. None if the coordinate has no derivative.
    Raises InvalidValue unless low < high.
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
    """A task space Y: a tuple of coordinates; `first + second` has the coordinates of both."""

    coordinates: tuple[Coordinate, ...]

    def __post_init__(self) -> None:
        if not self.coordinates:
            raise InvalidValue("a task space needs at least one coordinate: see mobee.tasks.")
        twice = sorted({name for name in self.names if self.names.count(name) > 1})
        if twice:
            raise InvalidValue(f"the task space has {', '.join(twice)} more than once; names of coordinates must differ.")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(one.name for one in self.coordinates)

    @property
    def box(self) -> Array:
        """Lowest and highest value of each of the m coordinates, (m, 2), in the units of the coordinates."""
        return np.array([(one.low, one.high) for one in self.coordinates])

    def of(self, pose: Pose) -> Array:
        """Compute the task coordinates (N, m) of a batch of poses q (N, n); raises InvalidValue if a coordinate is not finite."""
        y = np.stack([np.asarray(one.function(pose), dtype=np.float64) for one in self.coordinates], axis=-1)
        if not np.isfinite(y).all():
            where = np.argwhere(~np.isfinite(y))[0]
            raise InvalidValue(f"task coordinate {self.names[where[-1]]!r} is {y[tuple(where)]} in a pose; it must be finite in all poses.")
        return y

    def aims(self, robot: Robot, y: Array) -> tuple[Aim, ...] | None:
        """Return the residuals of type `Aim` for least squares that are 0 at task coordinates y (m,).

        None if a coordinate has no derivative.
        """
        found: list[Aim] = []
        for one, value in zip(self.coordinates, y, strict=True):
            if one.aims is None:
                return None
            found += one.aims(robot, float(value))
        return tuple(found)

    def __add__(self, other: Task) -> Task:
        """Return the task space that has the coordinates of this task and then those of `other`."""
        return Task((*self.coordinates, *other.coordinates))


def place(marker: str, axes: str = AXES, box: Sequence[Range] = ()) -> Task:
    """Return a task space: a marker's position along the `axes` of the root frame (thesis table 3.2, second row).

    `axes`: "xyz" or some of these letters. `box`: (low, high) in m for each axis; required. Raises InvalidValue if `axes` is not valid or
    the number of ranges in `box` is not that of the axes.
    """
    if not axes or len(set(axes)) != len(axes) or not set(axes) <= set(AXES):
        raise InvalidValue(f"axes {axes!r}: valid are 'x', 'y', 'z', each at most once, as 'xy'.")
    if len(box) != len(axes):
        raise InvalidValue(f"box of {marker!r} has {len(box)} ranges; axes {axes!r} need {len(axes)}: [(low, high), ...] m.")
    return Task(
        tuple(
            _along(f"{marker} {axis}", marker, np.eye(3)[AXES.index(axis)], low, high) for axis, (low, high) in zip(axes, box, strict=True)
        )
    )


def along(marker: str, direction: ArrayLike, low: float, high: float) -> Task:
    """Return a task space of one coordinate: the scalar product of `direction` (3,), root frame, and the position of a marker [m].

    The direction may have any length; (1, 1, 1) gives the task space of thesis table 3.2, first row. `low`, `high`: range of the product in
    m. Raises InvalidValue if the direction is 0.
    """
    components = vector("direction", direction)
    if not components.any():
        raise InvalidValue("direction is 0; it must be 3 numbers that are not all 0.")
    return Task((_along(f"{marker} along {' '.join(f'{one:g}' for one in components)}", marker, components, low, high),))


def motors(ranges: Mapping[str, Range]) -> Task:
    """Return a task space: the positions of motors (thesis table 3.2, third row).

    `ranges`: (low, high) by name of the motor, in rad, or in m for a motor that slides.
    """
    return Task(tuple(_motor(name, low, high) for name, (low, high) in ranges.items()))


def angle(marker: str, about: ArrayLike, zero: ArrayLike, low: float, high: float, direction: ArrayLike | None = None) -> Task:
    """Return a task space of one coordinate: the angle of a marker's direction about an axis, in (-pi, pi] rad.

    Roadmaps of the method "least_squares" also require that the direction is perpendicular to the axis; those of "nes" do not.

    Args:
        marker: its name.
        about: the axis (3,), root frame; the component of the direction along the axis is ignored.
        zero: (3,), root frame: the direction of angle 0, perpendicular to the axis.
        low: lowest angle [rad], at least -pi.
        high: highest angle [rad], at most pi: a roadmap does not wrap around.
        direction: (3,), in the marker's frame; None: the marker's normal.
    """
    axis, start = unit_vector("about", about), unit_vector("zero", zero)
    start = start - (start @ axis) * axis
    if np.linalg.norm(start) < 1e-6:
        raise InvalidValue(f"zero {zero!r} lies along the axis {about!r}; it must be perpendicular to it.")
    start /= np.linalg.norm(start)
    quarter = np.cross(axis, start)
    turned = None if direction is None else unit_vector("direction", direction)
    if not -math.pi <= low < high <= math.pi:
        raise InvalidValue(f"box of the angle of {marker!r} is ({low}, {high}) rad; it must be (low, high) within -pi and pi.")

    def function(pose: Pose) -> Array:
        pointing = pose.normal(marker) if turned is None else pose.rotation(marker) @ turned
        found: Array = np.arctan2(pointing @ quarter, pointing @ start)
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        pointing = m.normal if turned is None else m.rotation @ turned
        return (directed(m, pointing, math.cos(value) * start + math.sin(value) * quarter),)

    return Task((Coordinate(f"{marker} angle", "rad", float(low), float(high), function, aims),))


def function(f: Callable[[Pose], ArrayLike], low: float, high: float, name: str = "", unit: str = "") -> Task:
    """Return a task space of one coordinate: a function of the pose, between `low` and `high`.

    The coordinate has no derivative, so roadmaps over it need the method "nes".

    Args:
        f: takes a batch of N poses (`pose.q` (N, n), `pose.position(marker)` (N, 3), ...) and returns N numbers.  A function that takes one
            pose (`pose.position(marker)` (3,)) and returns one number is also accepted; it is called for each pose, which takes longer.
        low: lowest value.
        high: highest value.
        name: name of the coordinate; "": the name of the function.
        unit: unit of the values, for texts.
    """
    if not callable(f):
        raise InvalidValue(f"{f!r} is not a task coordinate: it must be a function of a pose.")
    called = name or getattr(f, "__name__", "function")
    return Task((Coordinate(called, unit, float(low), float(high), Function(f, contacts=False)),))


def _along(name: str, marker: str, direction: Array, low: float, high: float) -> Coordinate:
    def function(pose: Pose) -> Array:
        found: Array = pose.position(marker) @ direction
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        return (level(robot.marker(marker), direction, value),)

    return Coordinate(name, "m", float(low), float(high), function, aims)


def _motor(name: str, low: float, high: float) -> Coordinate:
    def function(pose: Pose) -> Array:
        found: Array = pose.q[..., pose.robot.motor_index(name)]
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        return (motor_at(robot.motor_index(name), value),)

    return Coordinate(name, "rad", float(low), float(high), function, aims)
