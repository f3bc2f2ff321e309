"""The right hand moves over the table, its palm to the side (thesis fig. 3.2, left): left and right, forward and back."""

from __future__ import annotations

from experiments.trm.body import ONE_HAND, RIGHT, TO_THE_LEFT, UP, at_table, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import costs, tasks

HEIGHT = 0.0  # m, 10 cm above the table


def example() -> Example:
    """The map."""
    model = at_table()
    return Example(
        title="palm to the side",
        figure="3.2, left",
        model=model,
        costs=(costs.orientation(RIGHT, TO_THE_LEFT), costs.plane(RIGHT, UP, HEIGHT), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xy", [(-0.56, -0.10), (-0.30, 0.46)]),
        spacing=0.02,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        way=[(-0.20, 0.20), (-0.44, 0.16), (-0.36, -0.08), (-0.26, 0.14)],
    )
