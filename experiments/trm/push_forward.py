"""Push a large object forward with both hands (thesis fig. 3.6).

Where the hands are to each other is fixed, as is their height; the task space is how far forward they are.  The object neither turns
nor goes aside.
"""

from __future__ import annotations

import mobee
from experiments.trm.body import BOTH_HANDS, LEFT, RIGHT, THUMBS_UP, TO_THE_RIGHT, UP, at_table
from experiments.trm.example import MARGIN, Example
from experiments.trm.grasp import between_palms, held
from mobee import costs, tasks

WIDTH, HEIGHT = 0.24, 0.0  # m


def example() -> Example:
    """The map."""
    model = at_table()
    between_palms(model, mobee.box(0.18, 0.20, WIDTH - 0.05), WIDTH)
    return Example(
        title="push forward",
        figure="3.6",
        model=model,
        costs=(
            *held(WIDTH),
            costs.orientation(RIGHT, THUMBS_UP),
            costs.plane(RIGHT, UP, HEIGHT),
            costs.plane(RIGHT, TO_THE_RIGHT, 0.5 * WIDTH),
            costs.collision(),
            costs.home(),
        ),
        task=tasks.place(RIGHT, "x", [(-0.56, -0.10)]),
        spacing=0.02,
        motors=BOTH_HANDS,
        markers=(LEFT, RIGHT),
        margin=MARGIN,
        way=[(-0.26,), (-0.42,)],
    )
