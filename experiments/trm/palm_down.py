"""The right hand moves over the table, its palm down (thesis fig. 3.2, right): left and right, forward and back."""

from __future__ import annotations

from experiments.trm.body import DOWN, ONE_HAND, RIGHT, UP, at_table, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import costs, tasks

HEIGHT = 0.0  # m, 10 cm above the table


def example() -> Example:
    """The map."""
    model = at_table()
    return Example(
        title="palm down",
        figure="3.2, right",
        model=model,
        costs=(costs.orientation(RIGHT, DOWN), costs.plane(RIGHT, UP, HEIGHT), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.56, -0.06), (-0.30, 0.50)]),
        spacing=0.02,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        way=[(-0.20, 0.24), (-0.44, 0.14), (-0.36, 0.30), (-0.18, 0.34)],
    )
