"""Reaching: core/reach.hpp says what its numbers are."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from mobee._core import ADDRESS, INTEGER, REAL, function
from mobee._core.tables import INTERVAL, WHOLE, View

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
    """A reach under way; whoever makes it keeps the tables."""

    _fields_ = (
        *((name, INTEGER) for name in ("part", "surface", "turned", "used")),
        *((name, View) for name in ("joints", "drives", "motors")),
        ("curve", ADDRESS),
        ("target", _VECTOR), ("wanted", _VECTOR), ("radius", REAL), ("point", _VECTOR), ("normal", _VECTOR),
        ("at", _VECTOR), ("facing", _VECTOR), ("error", _TWIST), ("missing", REAL),
        ("seen", _TWIST), ("left", REAL), ("best", REAL), ("since", REAL), ("begun", INTEGER),
    )  # fmt: skip


class Calls:
    """The functions of that file."""

    def __init__(self) -> None:
        self.add = function("reach_add", ADDRESS, ADDRESS, INTEGER, ADDRESS, ADDRESS, REAL, ADDRESS)
        self.goes_on = function("reach_goes_on", ADDRESS, ADDRESS, INTEGER, INTEGER, result=INTEGER)


@cache
def calls() -> Calls:
    """Found when they are first asked for."""
    return Calls()
