"""Twist a large object between both hands about the vertical (thesis fig. 3.10).

Where the hands are to each other is fixed, their palms are parallel and opposite, and the middle between them stays; the task space is the
angle of the right palm's normal in the plane of the table.
"""

from __future__ import annotations

import numpy as np

import mobee
from experiments.trm.body import BOTH_HANDS, LEFT, RIGHT, TO_THE_LEFT, UP, at_table, elbows_out
from experiments.trm.example import Example
from experiments.trm.grasp import between_palms, held
from mobee import costs, tasks

WIDTH, MIDDLE = 0.18, (-0.30, 0.0, 0.20)  # m


def example() -> Example:
    """The map."""
    model = at_table()
    between_palms(model, mobee.box(0.12, 0.16, WIDTH - 0.05), WIDTH)
    return Example(
        title="bimanual twist",
        figure="3.10",
        model=model,
        costs=(
            *held(WIDTH),
            costs.position(RIGHT, MIDDLE, tolerance=0.01, offset=(0.0, 0.0, 0.5 * WIDTH)),
            costs.across(RIGHT, UP),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, TO_THE_LEFT, -np.pi / 2, np.pi / 2),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=elbows_out(model.robot.home, model.robot),
        markers=(LEFT, RIGHT),
        views=("top",),
        way=[(np.deg2rad(-40.0),), (np.deg2rad(40.0),)],
    )
