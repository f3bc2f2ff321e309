"""What a task file holds: all that a map is built from, and what its pictures show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from experiments.drawing.filmstrip import View
from mobee import Model
from mobee.roadmap.building.task import Task
from mobee.roadmap.ik.term import Term
from mobee.robot.robot import Array

MARGIN = float(np.deg2rad(10.0))  # the default law lets no motor rest nearer to a limit


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """A map to be built by `mobee.build_roadmap`, and a motion in it.

    `figure`: of the thesis.  `spacing`: in the units of the task's coordinates.  `motors`: names of those that move, or of parts.
    `start`: (n,) rad, where the search begins and what all other motors keep; None: home.  `markers`: those that show the map.
    `way`: task coordinates through which the motion of the filmstrip goes, one point after the other.  `views`: of the filmstrip.
    `margin`: what motors keep from their limits [rad]; with MARGIN the control law lets the robot rest in every pose, so maps that
    can do with less room have it.
    """

    title: str
    figure: str
    model: Model
    costs: tuple[Term, ...]
    task: Task
    spacing: float | tuple[float, ...]
    motors: tuple[str, ...]
    way: Sequence[tuple[float, ...]]
    markers: tuple[str, ...] = ("right_palm",)
    views: Sequence[View] = ("oblique",)
    start: Array | None = None
    margin: float = 0.0
