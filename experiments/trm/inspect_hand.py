"""Turn the hand, and what it holds, before the eyes (thesis fig. 3.5).

The hand stays at one place and the face is turned to it; the task space is the angle of the palm's normal to the direction of gaze, in
the horizontal plane: 0 when the palm faces away, half a turn when it is seen from the front.
"""

from __future__ import annotations

import numpy as np

import mobee
from experiments.trm.body import FORWARD, NECK, ONE_HAND, RIGHT, THUMB, UP, alone, carry, elbows_out, grasping, left_aside
from experiments.trm.example import Example
from mobee import costs, tasks

PLACE = (-0.26, 0.05, 0.28)  # m


def example() -> Example:
    """The map."""
    model = alone()
    carry(model, "held", mobee.box(0.05, 0.05, 0.10), RIGHT, 0.04, THUMB)
    return Example(
        title="inspect",
        figure="3.5",
        model=model,
        costs=(
            costs.position(RIGHT, PLACE),
            costs.across(RIGHT, UP),
            costs.gaze(RIGHT, tolerance=np.deg2rad(10.0)),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, FORWARD, -np.pi / 2, np.pi),
        spacing=float(np.deg2rad(5.0)),
        motors=(*ONE_HAND, *NECK),
        start=elbows_out(grasping(left_aside(model.robot), model.robot, "r"), model.robot, "r"),
        markers=(RIGHT, "right_elbow"),  # the hand itself stays
        way=[(np.deg2rad(170.0),), (np.deg2rad(-60.0),)],
    )
