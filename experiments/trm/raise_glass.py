"""Raise a glass: what the hand holds stays upright wherever the hand goes (thesis fig. 3.3).

The thumb points up, and the hand may turn about that line as a glass may; the task space is the place of the hand.  For picking and
placing what must not be tipped over.
"""

from __future__ import annotations

import mobee
from experiments.trm.body import ONE_HAND, RIGHT, THUMB, UP, at_table, carry, grasping, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import costs, tasks


def example() -> Example:
    """The map."""
    model = at_table()
    carry(model, "glass", mobee.cylinder(0.03, 0.12), RIGHT, 0.045, THUMB)
    return Example(
        title="raise a glass",
        figure="3.3",
        model=model,
        costs=(costs.orientation(RIGHT, UP, direction=THUMB), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.02, 0.38)]),
        spacing=0.04,
        motors=ONE_HAND,
        start=grasping(left_aside(model.robot), model.robot, "r"),
        margin=MARGIN,
        way=[(-0.40, 0.20, 0.02), (-0.36, 0.10, 0.10), (-0.28, 0.08, 0.22)],
    )
