"""Both hands hold something, and move it up and down, forward and back (thesis fig. 3.1, left).

Where the hands are to each other is fixed, as by a box between them, and the box stays level and straight before the robot;
the task space is the height of the hands and how far forward they are.
"""

from __future__ import annotations

import mobee
from experiments.trm.body import BOTH_HANDS, LEFT, RIGHT, TO_THE_LEFT, TO_THE_RIGHT, at_table
from experiments.trm.example import MARGIN, Example
from experiments.trm.grasp import between_palms, held
from mobee import costs, tasks

WIDTH = 0.20  # m, from palm to palm


def example() -> Example:
    """The map."""
    model = at_table()
    between_palms(model, mobee.box(0.12, 0.16, WIDTH - 0.05), WIDTH)
    return Example(
        title="both hands held",
        figure="3.1, left",
        model=model,
        costs=(
            *held(WIDTH),
            costs.orientation(RIGHT, TO_THE_LEFT),
            costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * WIDTH),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "xz", [(-0.48, -0.14), (-0.02, 0.34)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        way=[(-0.24, 0.04), (-0.40, 0.04), (-0.30, 0.24), (-0.24, 0.26)],
    )
