"""Task spaces of thesis table 3.2 and of its examples; any function of a pose is a coordinate too.

Places are in m in the root frame, angles in rad.  `+` puts task spaces together: `place(...) + motors(...)` is the last row of the table.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.pose import Pose
from mobee.roadmap.building.task import Coordinate, Task
from mobee.roadmap.ik.aims import directed, level, motor_at
from mobee.roadmap.ik.costs import unit_vector, vector
from mobee.roadmap.ik.term import Aim, Function
from mobee.robot.robot import Robot

AXES = "xyz"
Range = tuple[float, float]


def place(marker: str, axes: str = AXES, box: Sequence[Range] = ()) -> Task:
    """Where a marker is, along some axes of the root frame (table 3.2, second row); `box`: (low, high) m of each axis."""
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
    """How far a marker is along a direction (3,): direction . x, in m times its length; (1, 1, 1): table 3.2, first row."""
    way = vector("direction", direction)
    if not way.any():
        raise InvalidValue("direction is 0; it must be (3,) numbers that are not all 0.")
    return Task((_along(f"{marker} along {' '.join(f'{one:g}' for one in way)}", marker, way, low, high),))


def motors(ranges: Mapping[str, Range]) -> Task:
    """Where motors are, by name, each in (low, high) rad (table 3.2, third row)."""
    return Task(tuple(_motor(name, low, high) for name, (low, high) in ranges.items()))


def angle(marker: str, about: ArrayLike, zero: ArrayLike, low: float, high: float, direction: ArrayLike | None = None) -> Task:
    """How far a direction of a marker is turned about an axis, in (-pi, pi] rad.

    Args:
        marker: its name.
        about: the axis (3,), root frame; what of the direction lies along it does not count.
        zero: (3,), root frame: what the angle is measured from; across the axis.
        low: rad, from -pi on.
        high: rad, up to pi: a map does not go round.
        direction: (3,), in the marker's frame; None: its normal.

    Least squares brings the direction across the axis, too.
    """
    axis, start = unit_vector("about", about), unit_vector("zero", zero)
    start = start - (start @ axis) * axis
    if np.linalg.norm(start) < 1e-6:
        raise InvalidValue(f"zero {zero!r} lies along the axis {about!r}; it must point across it.")
    start /= np.linalg.norm(start)
    quarter = np.cross(axis, start)
    turned = None if direction is None else unit_vector("direction", direction)
    if not -math.pi <= low < high <= math.pi:
        raise InvalidValue(f"box of the angle of {marker!r} is ({low}, {high}) rad; it must be (low, high) within -pi and pi.")

    def function(pose: Pose) -> Array:
        way = pose.normal(marker) if turned is None else pose.rotation(marker) @ turned
        found: Array = np.arctan2(way @ quarter, way @ start)
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        m = robot.marker(marker)
        way = m.normal if turned is None else m.rotation @ turned
        return (directed(m, way, math.cos(value) * start + math.sin(value) * quarter),)

    return Task((Coordinate(f"{marker} angle", "rad", float(low), float(high), function, aims),))


def function(f: Callable[[Pose], ArrayLike], low: float, high: float, name: str = "", unit: str = "") -> Task:
    """Any function of the pose, between low and high; it has no derivative, so least squares cannot follow it.

    `f`: takes a batch of N poses (`pose.q` (N, n), `pose.position(marker)` (N, 3), ...) and returns N numbers; or it is written for one
    pose (`pose.position(marker)` (3,)) and returns one number: then it is called pose by pose, which takes longer.
    """
    if not callable(f):
        raise InvalidValue(f"{f!r} is no task coordinate: it must be a function of a pose.")
    called = name or getattr(f, "__name__", "function")
    return Task((Coordinate(called, unit, float(low), float(high), Function(f, contacts=False)),))


def _along(name: str, marker: str, way: Array, low: float, high: float) -> Coordinate:
    def function(pose: Pose) -> Array:
        found: Array = pose.position(marker) @ way
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        return (level(robot.marker(marker), way, value),)

    return Coordinate(name, "m", float(low), float(high), function, aims)


def _motor(name: str, low: float, high: float) -> Coordinate:
    def function(pose: Pose) -> Array:
        found: Array = pose.q[..., pose.robot.motor_index(name)]
        return found

    def aims(robot: Robot, value: float) -> tuple[Aim, ...]:
        return (motor_at(robot.motor_index(name), value),)

    return Coordinate(name, "rad", float(low), float(high), function, aims)
