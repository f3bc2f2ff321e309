# SPDX-License-Identifier: Apache-2.0
"""The script: postures to go to and targets to reach for."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from mobee import Outcome, ReachOutcome, ReachPlant, ReachTarget

PART, MARKER = "right_arm", "right_palm"
FAR = np.array([-3.0, 0.2, 0.1])  # out of reach


def perform(plant: ReachPlant) -> Iterator[dict[str, Any]]:
    """Act, reach free and near the table, with and without being drawn back; what each came to."""
    where = plant.robot.part(PART).slice
    home, middle = plant.robot.home[where], plant.robot.limits[where].mean(axis=1)
    yield fields(plant.act(PART, home + 0.5 * (middle - home)))
    plant.present(ReachTarget(np.array([-0.25, 0.2, 0.05])))
    yield reached(plant.reach(PART, MARKER))
    plant.present(ReachTarget(np.array([-0.35, 0.15, 0.15]), aim="surface"))
    yield reached(plant.reach(PART, MARKER, stay=True))
    yield fields(plant.act(PART, home + 0.4 * (middle - home)))


def fields(outcome: Outcome) -> dict[str, Any]:
    return {
        "q": outcome.q.tolist(),
        "settled": outcome.settled,
        "duration": round(outcome.duration, 9),
        "touched": list(outcome.touched),
    }


def reached(outcome: ReachOutcome) -> dict[str, Any]:
    return {
        "marker": outcome.marker.tolist(),
        "q": outcome.q.tolist(),
        "missing": outcome.missing,
        "settled": outcome.settled,
        "duration": round(outcome.duration, 9),
        "touched": list(outcome.touched),
        "after": fields(outcome.after),
    }
