"""Reach into a box that is open above (thesis fig. 3.8).

Nothing is asked of the hand but to touch nothing; the task space is its place, in the box and above it.  For picking from the box and
placing into it.
"""

from __future__ import annotations

import mobee
from experiments.trm.body import ONE_HAND, RIGHT, alone, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import Model, costs, tasks

MIDDLE, FLOOR = (-0.27, 0.17), -0.22  # m
SIDE, WALL, THICK = 0.28, 0.14, 0.01  # m


def example() -> Example:
    """The map."""
    model = alone()
    _put_box(model)
    x, y = MIDDLE
    return Example(
        title="reach into a box",
        figure="3.8",
        model=model,
        costs=(costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(x - 0.16, x + 0.16), (y - 0.16, y + 0.16), (FLOOR, 0.14)]),
        spacing=0.03,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        way=[(x + 0.06, y, 0.05), (x, y, FLOOR + 0.09), (x - 0.03, y - 0.03, 0.08), (x - 0.10, y - 0.14, 0.06)],
    )


def _put_box(model: Model) -> None:
    x, y = MIDDLE
    half, middle = 0.5 * (SIDE - THICK), FLOOR + 0.5 * WALL
    model.world.add("floor", mobee.box(SIDE, SIDE, THICK), position=(x, y, FLOOR))
    for name, sign in (("far wall", -1), ("near wall", 1)):
        model.world.add(name, mobee.box(THICK, SIDE, WALL), position=(x + sign * half, y, middle))
    for name, sign in (("left wall", -1), ("right wall", 1)):
        model.world.add(name, mobee.box(SIDE, THICK, WALL), position=(x, y + sign * half, middle))
