"""Push a large object to the side with both hands (thesis fig. 3.7).

Where the hands are to each other is fixed, as is their height; the task space is how far left or right they are.  The object neither
turns nor goes forward.
"""

from __future__ import annotations

import mobee
from experiments.trm.body import BOTH_HANDS, LEFT, RIGHT, THUMBS_UP, UP, at_table
from experiments.trm.example import MARGIN, Example
from experiments.trm.grasp import between_palms, held
from mobee import costs, tasks

WIDTH, HEIGHT, BEFORE = 0.20, 0.0, 0.32  # m


def example() -> Example:
    """The map."""
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, WIDTH - 0.05), WIDTH)
    return Example(
        title="push over",
        figure="3.7",
        model=model,
        costs=(
            *held(WIDTH),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.plane(RIGHT, UP, HEIGHT),
            costs.plane(RIGHT, (1, 0, 0), -BEFORE),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "y", [(-0.30, 0.50)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        way=[(0.22,), (-0.02,)],
    )
