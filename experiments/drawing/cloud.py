"""Where markers are in many poses, as a cloud of points about the robot (as thesis figs. 3.1, 3.2)."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from experiments.drawing.filmstrip import View, pictures_of
from experiments.drawing.scene import object_solids, robot_solids
from experiments.drawing.sheet import Panel, write_sheet
from experiments.drawing.solid import Color, Solid, ball
from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.model import Model
from mobee.model.pose import Pose

RADIUS = 0.0045  # m, of a point
LOW, HIGH = np.array([0.16, 0.42, 0.92]), np.array([1.00, 0.70, 0.12])  # colours of the least and the largest value
MIDDLE = np.array([0.20, 0.78, 0.58])
VEILED = 0.2
GROUP = -3


def marker_cloud(
    model: Model,
    q: ArrayLike,
    markers: str | Sequence[str],
    path: Path,
    shown: ArrayLike | None = None,
    views: Sequence[View] = ("front", "side", "oblique"),
    values: ArrayLike | None = None,
    title: str = "",
    height: int = 400,
) -> Path:
    """Write a PNG of the places of markers in the poses q (P, n) rad, beside the robot in the pose `shown` (n,), at home if None.

    `values` (P,): what the points' colours tell, blue for the least, orange for the largest; the height of each if None.
    Raises InvalidValue, UnknownName.
    """
    pose, names = model.evaluate(np.atleast_2d(np.asarray(q, dtype=np.float64))), [markers] if isinstance(markers, str) else list(markers)
    if not names or not len(pose.q):
        raise InvalidValue(f"{len(pose.q)} poses and {len(names)} markers: must be at least one of each")
    places = np.concatenate([pose.position(name) for name in names])
    told = places[:, 2] if values is None else np.tile(np.asarray(values, dtype=np.float64), len(names))
    if told.shape != places.shape[:1]:
        raise InvalidValue(f"{len(pose.q)} poses and values of shape {np.shape(values)}: must be one value a pose")
    scene = cloud_solids(model.evaluate(model.robot.home if shown is None else shown), places, told)
    row = [Panel(pictures_of([scene], view, height)[0], view if isinstance(view, str) else "") for view in views]
    return write_sheet([(title, row)], path)


def cloud_solids(pose: Pose, places: Array, values: Array) -> list[Solid]:
    """The robot in a pose, the world about it, and the points (P, 3) m in the colours of their values (P,)."""
    low, high = float(values.min()), float(values.max())
    shares = (values - low) / (high - low) if high > low else np.full(len(values), 0.5)
    points = [ball(place, RADIUS, _color(float(share)), VEILED, GROUP) for place, share in zip(places, shares, strict=True)]
    return [*robot_solids(pose, bright=()), *object_solids(pose.objects), *points]


def _color(share: float) -> Color:
    """From LOW at 0 over MIDDLE to HIGH at 1."""
    first, second, part = (LOW, MIDDLE, 2.0 * share) if share < 0.5 else (MIDDLE, HIGH, 2.0 * share - 1.0)
    red, green, blue = ((1.0 - part) * first + part * second).tolist()
    return red, green, blue
