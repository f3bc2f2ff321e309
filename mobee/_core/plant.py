"""The offline plant's ticks: core/plant.cpp says what the numbers are."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from mobee._core import ADDRESS, BYTES, INTEGER, REAL, function, law, motors, reach
from mobee._core.tables import INTERVAL, WHOLE, View

PART = np.dtype([("motors", INTERVAL), ("under_way", WHOLE), ("verdict", WHOLE), ("begun", "f8"), ("next_look", "f8")])
"""A part and its action, see `PartAction`."""
RECORD_DEPTHS = 2
ALL_TICKS_DONE, ACTION_ENDED, STATE_LOST = range(3)


class Plant(ctypes.Structure):
    """A plant; whoever makes it keeps all that it points to."""

    _fields_ = (
        *((name, ADDRESS) for name in ("near", "law", "law_state", "attractor", "client", "forces")),
        ("rows", INTEGER), ("reaches", View),
        ("motors", ADDRESS), ("commands", ADDRESS), ("command_age", INTEGER), ("substeps", INTEGER), ("dt", REAL),
        ("noise", ADDRESS), ("parts", View),
        *((name, ADDRESS) for name in ("q", "torque", "total", "record")),
        *((name, INTEGER) for name in ("ticks", "most", "done", "end")),
    )  # fmt: skip


STRUCTURES = (
    law.MOTOR_GAINS, law.CLAUSE_ROW, law.CLAUSE_ENTRY, law.STATE, law.Law, reach.DRIVE, reach.JOINT, reach.PULLED, reach.Reach,
    motors.NUMBERS, motors.STATE, motors.Motors, PART, Plant,
)  # fmt: skip
"""All that are laid out both here and there."""


class Calls:
    """The functions of that file."""

    def __init__(self) -> None:
        self.run = function("plant_run", ADDRESS)
        self.run_many = function("plants_run", BYTES, INTEGER, INTEGER)
        self.sizes = function("plant_sizes", ADDRESS)


@cache
def calls() -> Calls:
    """Found when they are first asked for."""
    return Calls()
