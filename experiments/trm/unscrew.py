"""Unscrew the cap of a bottle (thesis fig. 3.11).

The left hand keeps its place and orientation, the right one its place above it and its palm down; the task space is how far the right
hand is turned about its palm's normal, from where its fingers point forward.
"""

from __future__ import annotations

import numpy as np

import mobee
from experiments.trm.body import BOTH_HANDS, DOWN, FINGERS, FORWARD, LEFT, RIGHT, THUMB, THUMBS_UP, UP, alone, carry, grasping
from experiments.trm.example import Example
from mobee import costs, tasks

BOTTLE = np.array([-0.32, 0.02, 0.05])  # m, where the left hand holds it


def example() -> Example:
    """The map."""
    model = alone()
    carry(model, "bottle", mobee.cylinder(0.025, 0.20), LEFT, 0.045, THUMB)
    return Example(
        title="unscrew",
        figure="3.11",
        model=model,
        costs=(
            costs.position(LEFT, BOTTLE - (0.0, 0.045, 0.0)),
            costs.orientation(LEFT, THUMBS_UP),
            costs.position(RIGHT, BOTTLE + (0.0, 0.0, 0.13)),
            costs.orientation(RIGHT, DOWN),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.angle(RIGHT, UP, FORWARD, -np.pi, np.pi, direction=FINGERS),
        spacing=float(np.deg2rad(5.0)),
        motors=BOTH_HANDS,
        start=grasping(model.robot.home, model.robot),
        markers=(RIGHT, "right_elbow"),  # the hands themselves stay
        way=[(np.deg2rad(0.0),), (np.deg2rad(75.0),)],
    )
