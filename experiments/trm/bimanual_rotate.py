"""Rotate a large object between both hands about the forward direction, as a steering wheel (thesis fig. 3.9).

Where the hands are to each other is fixed, their palms are parallel and opposite, and the middle between them stays; the task space is the
angle of the right palm's normal in the plane of up/down and left/right.
"""

from __future__ import annotations

import numpy as np

import mobee
from experiments.trm.body import BOTH_HANDS, FORWARD, LEFT, RIGHT, TO_THE_LEFT, alone, elbows_out
from experiments.trm.example import Example
from experiments.trm.grasp import between_palms, held
from mobee import costs, tasks

WIDTH, MIDDLE = 0.20, (-0.30, 0.0, 0.20)  # m


def example() -> Example:
    """The map."""
    model = alone()
    between_palms(model, mobee.box(0.12, 0.12, WIDTH - 0.05), WIDTH)
    return Example(
        title="bimanual rotate",
        figure="3.9",
        model=model,
        costs=(
            *held(WIDTH),
            costs.position(RIGHT, MIDDLE, tolerance=0.01, offset=(0.0, 0.0, 0.5 * WIDTH)),
            costs.across(RIGHT, FORWARD),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, FORWARD, TO_THE_LEFT, -0.4 * np.pi, 0.4 * np.pi),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=elbows_out(model.robot.home, model.robot),
        markers=(LEFT, RIGHT),
        views=("front",),
        way=[(np.deg2rad(-55.0),), (np.deg2rad(55.0),)],
    )
