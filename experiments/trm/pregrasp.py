"""The right hand over all of the table that it reaches, palm down, as before a grasp (thesis fig. 4.8): 4400 poses.

The thesis counts one for every square centimetre of half a square metre, for which both hands are needed; the right palm reaches 0.3 m^2.
"""

from __future__ import annotations

from experiments.trm.body import DOWN, ONE_HAND, RIGHT, UP, at_table, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import costs, tasks

HEIGHT = -0.04  # m, 6 cm above the table
SPACING = 0.008  # m


def example() -> Example:
    """The map."""
    model = at_table()
    return Example(
        title="pre-grasp",
        figure="4.8",
        model=model,
        costs=(costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, HEIGHT), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.74, -0.14), (-0.75, 0.75)]),
        spacing=SPACING,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        way=[(-0.20, 0.24), (-0.44, 0.14), (-0.36, 0.30), (-0.18, 0.34)],
    )
