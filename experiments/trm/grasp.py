"""What two hands hold between their palms."""

from __future__ import annotations

import numpy as np

from experiments.trm.body import LEFT, RIGHT, carry
from mobee import Geometry, Model, costs
from mobee.roadmap.ik.term import Term

THING = "held"


def held(width: float) -> tuple[Term, Term]:
    """The palms face each other, that far [m] apart, and neither slips: position and orientation of the one in the frame of the other."""
    return costs.relative_position(RIGHT, LEFT, (0.0, 0.0, -width)), costs.relative_orientation(RIGHT, LEFT, np.eye(3))


def between_palms(model: Model, shape: Geometry, width: float) -> None:
    """Show what they hold, its z axis from palm to palm, its x axis along the fingers."""
    carry(model, THING, shape, LEFT, 0.5 * width, (0, 0, 1))
