"""Look at what both hands hold from all sides: the hands stay, the head moves (thesis figs. 3.4; 3.1, centre).

Both hands keep their place and orientation, the face stays turned to what they hold; the task space is where the head is: left and
right, forward and back.
"""

from __future__ import annotations

import numpy as np

import mobee
from experiments.trm.body import BOTH_HANDS, LEFT, NECK, RIGHT, THUMBS_UP, TO_THE_LEFT, at_table
from experiments.trm.example import Example
from experiments.trm.grasp import between_palms
from mobee import costs, tasks

WIDTH = 0.20  # m, from palm to palm
MIDDLE = np.array([-0.30, 0.0, 0.05])  # m


def example() -> Example:
    """The map."""
    model = at_table()
    between_palms(model, mobee.box(0.10, 0.12, WIDTH - 0.05), WIDTH)
    across = np.multiply(0.5 * WIDTH, TO_THE_LEFT)
    return Example(
        title="bimanual inspect",
        figure="3.1, 3.4",
        model=model,
        costs=(
            costs.position(LEFT, MIDDLE + across),
            costs.position(RIGHT, MIDDLE - across),
            costs.orientation(LEFT, THUMBS_UP),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.gaze(MIDDLE, tolerance=np.deg2rad(10.0)),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place("head", "xy", [(-0.12, 0.06), (-0.13, 0.13)]),
        spacing=0.01,
        motors=(*BOTH_HANDS, *NECK),
        markers=("head",),
        way=[(0.02, 0.0), (-0.04, 0.06), (-0.06, 0.0), (-0.04, -0.06)],
    )
