"""The motors of a simulated robot, and references that they can follow: core/motors.hpp says what the numbers are."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from mobee._core import ADDRESS, INTEGER, REAL, function
from mobee._core.tables import WHOLE, View

NUMBERS = np.dtype(
    [
        *((name, "f8") for name in ("low", "high", "max_velocity", "max_acceleration", "max_torque", "share", "play", "friction")),
        ("delay", WHOLE),
    ]
)
STATE = np.dtype(
    [
        *((name, "f8") for name in ("q", "velocity", "effort", "motor_q", "motor_velocity")),
        *((name, "f8") for name in ("dragged", "rest", "reference", "load", "left")),
        ("mode", WHOLE), ("resting", WHOLE),
    ]
)  # fmt: skip
MODES = ("position", "velocity", "torque", "hold")


class Motors(ctypes.Structure):
    """The motors; whoever makes it keeps the tables."""

    _fields_ = (
        ("living", View), ("numbers", View), ("state", ADDRESS), ("line", ADDRESS), ("rows", INTEGER), ("newest", INTEGER),
        ("seed", ctypes.c_uint64), ("drawn", ADDRESS), ("drawn_from", INTEGER),
    )  # fmt: skip


class Braking(ctypes.Structure):
    """Limits of references, each (n,), and the velocities asked for now; whoever makes it keeps the arrays."""

    _fields_ = (
        ("count", INTEGER), ("lower", ADDRESS), ("upper", ADDRESS), ("fastest", ADDRESS), ("change", ADDRESS), ("velocity", ADDRESS),
        ("dt", REAL),
    )  # fmt: skip


class Calls:
    """The functions of that file."""

    def __init__(self) -> None:
        self.enter = function("motors_enter", ADDRESS, INTEGER, INTEGER, INTEGER)
        self.drive = function("motors_drive", ADDRESS, REAL)
        self.move = function("motors_move", ADDRESS, INTEGER, REAL)
        self.adopt = function("motors_adopt", ADDRESS, ADDRESS, REAL)
        self.read = function("motors_read", ADDRESS, INTEGER, ADDRESS, ADDRESS)
        self.to_velocity = function("braking_to_velocity", ADDRESS, ADDRESS, ADDRESS)
        self.to_position = function("braking_to_position", ADDRESS, ADDRESS, ADDRESS)
        self.runs_out = function("braking_runs_out", ADDRESS, ADDRESS, ADDRESS, result=ctypes.c_bool)


@cache
def calls() -> Calls:
    """Found when they are first asked for."""
    return Calls()
