"""The right hand goes anywhere while its elbow stays down (thesis fig. 3.1, right).

The elbow is never higher than 10 cm below the shoulder; the task space is the place of the hand.
"""

from __future__ import annotations

from experiments.trm.body import ONE_HAND, RIGHT, UP, at_table, left_aside
from experiments.trm.example import MARGIN, Example
from mobee import costs, tasks

HIGHEST = 0.05  # m, of the elbow


def example() -> Example:
    """The map."""
    model = at_table()
    return Example(
        title="elbow down",
        figure="3.1, right",
        model=model,
        costs=(costs.at_most("right_elbow", UP, HIGHEST), costs.collision(), costs.home()),
        task=tasks.place(RIGHT, "xyz", [(-0.48, -0.12), (-0.20, 0.44), (-0.06, 0.38)]),
        spacing=0.04,
        motors=ONE_HAND,
        start=left_aside(model.robot),
        margin=MARGIN,
        way=[(-0.26, 0.20, 0.0), (-0.40, 0.06, 0.02), (-0.26, 0.06, 0.22), (-0.22, 0.30, 0.14)],
    )
