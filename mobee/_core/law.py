# SPDX-License-Identifier: Apache-2.0
"""The control law and reaching: declares core/law.cpp and core/reach.cpp; their headers document the numbers."""

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
"""The state of a motor under the law: rad/s, rad/s^2, the velocity commanded last, the position reference, N m added to a torque."""
SETTLE = ("speed", "acceleration", "first_look", "interval", "timeout")

TERM_GAINS = ("max_constraint", "contact_gain", "contact_slope", "max_contact")
"""The numbers of the terms that are common to all motors, by their names in `Gains`."""
MODALITIES = ("position", "velocity", "torque")


class Settle(ctypes.Structure):
    """The thresholds of the settle test."""

    _fields_ = tuple((name, REAL) for name in SETTLE)


class SettleTest(ctypes.Structure):
    """The state of a settle test, s."""

    _fields_ = (("begun", REAL), ("next_look", REAL))


class Law(ctypes.Structure):
    """A law with its numbers; the caller keeps the tables alive."""

    _fields_ = (
        *((name, View) for name in ("motors", "active", "felt", "parts", "clauses", "rows", "entries")),
        *((name, INTEGER) for name in ("published", "touching", "direction", "modality")),
        *((name, REAL) for name in TERM_GAINS),
        ("settle", Settle),
    )


DRIVE = np.dtype([("motor", WHOLE), ("pulled", WHOLE), ("scale", "f8"), ("lever", "f8")])
JOINT = np.dtype(
    [
        ("slides", WHOLE), ("pulled", WHOLE), ("drives", INTERVAL), ("axis", "f8", 3), ("pivot", "f8", 3), ("offset", "f8"),
        ("angle", "f8"), ("sine", "f8"), ("cosine", "f8"), ("seen", "f8", 3), ("frame", "f8", (3, 3)), ("motion", "f8", 3),
        ("turning", "f8", 3),
    ]
)  # fmt: skip
PULLED = np.dtype(
    [
        ("motor", WHOLE), ("column", "f8", 6),
        *((name, "f8") for name in ("slope", "ease", "force", "way", "before", "bent", "limited", "held")),
    ]
)  # fmt: skip

_VECTOR, _TWIST = 3 * REAL, 6 * REAL


class Reach(ctypes.Structure):
    """A reach in progress; the caller keeps the tables alive."""

    _fields_ = (
        *((name, INTEGER) for name in ("part", "surface", "turned", "used")),
        *((name, View) for name in ("joints", "drives", "motors")),
        ("curve", ADDRESS),
        ("target", _VECTOR), ("wanted", _VECTOR), ("radius", REAL), ("point", _VECTOR), ("normal", _VECTOR),
        ("at", _VECTOR), ("facing", _VECTOR), ("error", _TWIST), ("missing", REAL),
        ("seen", _TWIST), ("left", REAL), ("best", REAL), ("since", REAL), ("begun", INTEGER),
    )  # fmt: skip


class Calls:
    """The functions of these source files."""

    def __init__(self) -> None:
        self.forces = function("law_forces", ADDRESS, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.client = function("law_client", ADDRESS, ADDRESS, ADDRESS)
        self.step = function("law_step", ADDRESS, ADDRESS, REAL, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.add_reaches = function("reach_add", ADDRESS, ADDRESS, INTEGER, ADDRESS, ADDRESS, REAL, ADDRESS)
        self.reach_goes_on = function("reach_goes_on", ADDRESS, ADDRESS, INTEGER, INTEGER, result=INTEGER)
        self.look = function("law_look", ADDRESS, ADDRESS, REAL, ADDRESS, INTEGER, result=INTEGER)


calls = cache(Calls)
"""Return the functions; the library is loaded at the first call."""


@cache
def term_names() -> tuple[str, ...]:
    """Return the names of the forces, in the order in which the core fills and adds them."""
    name = function("law_term", INTEGER, result=ctypes.c_char_p)
    return tuple(found.decode() for found in takewhile(bool, map(name, count())))


@cache
def state_term_names() -> tuple[str, ...]:
    """Return the names of the forces that depend on the law's state."""
    moving = function("law_moving", INTEGER, result=INTEGER)
    return tuple(name for index, name in enumerate(term_names()) if moving(index))
