"""What a task file holds: all that a map is built from, and what its pictures show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from experiments.drawing.filmstrip import View
from mobee import Model
from mobee.roadmap.task import Task
from mobee.roadmap.term import Term
from mobee.robot.robot import Array


@dataclass(frozen=True, slots=True, eq=False)
class Example:
    """A map to be built by `mobee.build_roadmap`, and a motion in it.

    `figure`: of the thesis.  `spacing`: in the units of the task's coordinates.  `motors`: names of those that move, or of parts.
    `start`: (n,) rad, where the search begins and what all other motors keep; None: home.  `markers`: those that show the map.
    `way`: task coordinates through which the motion of the filmstrip goes, one point after the other.  `views`: of the filmstrip.
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
