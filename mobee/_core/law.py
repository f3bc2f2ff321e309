"""The control law: core/law.hpp says what its numbers are."""

from __future__ import annotations

import ctypes
from functools import cache
from itertools import count, takewhile

import numpy as np

from mobee._core import ADDRESS, INTEGER, REAL, function
from mobee._core.tables import INTERVAL, WHOLE, View, columns

MOTOR_GAINS = columns(
    "low", "high", "max_spring", "spring_knee", "damping", "limit_slope", "below", "above", "client_slope", "max_client", "client_knee",
    "max_speed", "max_acceleration", "max_torque", "leash", "unit", "fine",
)  # fmt: skip
CLAUSE_ROW = np.dtype([("offset", "f8"), ("zone", "f8"), ("entries", INTERVAL)])
CLAUSE_ENTRY = np.dtype([("motor", WHOLE), ("factor", "f8"), ("normal", "f8")])
STATE = columns("velocity", "acceleration", "sent", "reference", "feedforward")
"""A motor's state under the law: rad/s, rad/s^2, the velocity commanded last, the position reference, and N m added to a torque."""
SETTLE = ("speed", "acceleration", "first_look", "interval", "timeout")

TERM_GAINS = ("max_constraint", "contact_gain", "contact_slope", "max_contact")
"""The numbers of the terms that are the same for all motors, by their names in `Gains`."""
MODALITIES = ("position", "velocity", "torque")
VERDICTS = ("moving", "settled", "timeout")


class Settle(ctypes.Structure):
    """The thresholds of the settle test."""

    _fields_ = tuple((name, REAL) for name in SETTLE)


class SettleTest(ctypes.Structure):
    """What a settle test remembers, s."""

    _fields_ = (("begun", REAL), ("next_look", REAL))


class Law(ctypes.Structure):
    """A law with its numbers; whoever makes it keeps the tables."""

    _fields_ = (
        *((name, View) for name in ("motors", "active", "felt", "parts", "clauses", "rows", "entries")),
        *((name, INTEGER) for name in ("published", "touching", "direction", "modality")),
        *((name, REAL) for name in TERM_GAINS),
        ("settle", Settle),
    )


class Calls:
    """The functions of that file."""

    def __init__(self) -> None:
        self.forces = function("law_forces", ADDRESS, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.client = function("law_client", ADDRESS, ADDRESS, ADDRESS)
        self.step = function("law_step", ADDRESS, ADDRESS, REAL, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.look = function("law_look", ADDRESS, ADDRESS, REAL, ADDRESS, INTEGER, result=INTEGER)


@cache
def calls() -> Calls:
    """Found when they are first asked for."""
    return Calls()


@cache
def term_names() -> tuple[str, ...]:
    """The names of the forces, in the order in which the core fills and adds them."""
    name = function("law_term", INTEGER, result=ctypes.c_char_p)
    return tuple(found.decode() for found in takewhile(bool, map(name, count())))


@cache
def moving_names() -> tuple[str, ...]:
    """Those of them that depend on the law's state."""
    moving = function("law_moving", INTEGER, result=INTEGER)
    return tuple(name for index, name in enumerate(term_names()) if moving(index))
