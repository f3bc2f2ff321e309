# SPDX-License-Identifier: Apache-2.0
"""Declares the structures and functions of the compiled control law and reaches; core/law.hpp and core/reach.hpp explain the fields."""

from __future__ import annotations

import ctypes
from functools import cache
from itertools import count, takewhile

import numpy as np

from mobee._core import ADDRESS, INTEGER, INTERVAL, REAL, WHOLE, View, columns, function

MOTOR_GAINS = columns(
    "low", "high", "max_spring", "spring_knee", "damping", "limit_slope", "low_zone", "high_zone", "client_slope", "max_client",
    "client_knee", "max_speed", "max_acceleration", "max_torque", "max_lead", "unit", "settle_unit",
)  # fmt: skip
CLAUSE_ROW = np.dtype([("offset", "f8"), ("zone", "f8"), ("entries", INTERVAL)])
CLAUSE_ENTRY = np.dtype([("motor", WHOLE), ("factor", "f8"), ("normal", "f8")])
STATE = columns("velocity", "acceleration", "commanded", "reference", "feedforward", "goal_velocity", "goal_time")
"""The type of the state of a motor under the law: velocity [rad/s], acceleration [rad/s^2], last velocity command [rad/s], position
reference [rad], feedforward torque [N m]; the velocity of an attractor that moves [rad/s], and the time for which it is valid [s]."""
SETTLE = ("speed", "acceleration", "first_check", "interval", "timeout")

TERM_GAINS = ("max_constraint", "contact_gain", "contact_slope", "max_contact")
"""The gains that are common to all motors, by their names in `mobee.control.gains.Gains`."""
MODALITIES = ("position", "velocity", "torque")


class Settle(ctypes.Structure):
    """The thresholds and times of the settle test as a C structure of the compiled core; `mobee.control.gains.Settle` explains the fields.

    The settle test ends an action when all its motors are slow, or at a timeout.
    """

    _fields_ = tuple((name, REAL) for name in SETTLE)


class SettleTest(ctypes.Structure):
    """The state of the settle test, which ends an action when all its motors are slow, or at a timeout.

    `start`: time at which the action started [s]. `next_check`: time of the next check [s].
    """

    _fields_ = (("start", REAL), ("next_check", REAL))


class Law(ctypes.Structure):
    """The control law of one robot with its gains, as a C structure of the compiled core; core/law.hpp explains the fields.

    The first seven fields contain the addresses of tables (motors, parts, clauses, ...); the caller must keep these tables alive.
    """

    _fields_ = (
        *((name, View) for name in ("motors", "active", "constrained", "parts", "clauses", "rows", "entries")),
        *((name, INTEGER) for name in ("published", "contact_forces", "keeps_direction", "modality")),
        *((name, REAL) for name in TERM_GAINS),
        ("settle", Settle),
    )


DRIVE = np.dtype([("motor", WHOLE), ("pulled", WHOLE), ("scale", "f8"), ("lever", "f8")])
JOINT = np.dtype(
    [
        ("slides", WHOLE), ("pulled", WHOLE), ("drives", INTERVAL), ("axis", "f8", 3), ("pivot", "f8", 3), ("offset", "f8"),
        ("angle", "f8"), ("sine", "f8"), ("cosine", "f8"), ("marker", "f8", 3), ("frame", "f8", (3, 3)), ("linear", "f8", 3),
        ("angular", "f8", 3),
    ]
)  # fmt: skip
PULLED = np.dtype(
    [
        ("motor", WHOLE), ("column", "f8", 6),
        *((name, "f8") for name in ("descent", "mobility", "force", "escape", "last_escape")),
        *((name, "f8") for name in ("bend_direction", "limit_resistance", "obstruction")),
    ]
)  # fmt: skip

_VECTOR, _TWIST = 3 * REAL, 6 * REAL


class Reach(ctypes.Structure):
    """A reach in progress, as a C structure of the compiled core; core/reach.hpp explains the fields.

    In a reach a force pulls a marker (a point on a link) to a target. The caller must keep the tables alive to which the structure points.
    """

    _fields_ = (
        *((name, INTEGER) for name in ("part", "to_surface", "turns_normal", "faces_target", "joint_count")),
        *((name, View) for name in ("joints", "drives", "motors")),
        ("curvature", ADDRESS),
        ("target", _VECTOR), ("target_normal", _VECTOR), ("radius", REAL), ("point", _VECTOR), ("normal", _VECTOR),
        ("marker_position", _VECTOR), ("marker_normal", _VECTOR), ("error", _TWIST), ("distance", REAL),
        ("smoothed_error", _TWIST), ("smoothed_distance", REAL), ("least_distance", REAL), ("time_without_progress", REAL),
        ("started", INTEGER), ("escapes", INTEGER),
    )  # fmt: skip


class Calls:
    """The compiled functions of the control law and of reaches, as attributes; core/law.cpp and core/reach.cpp document their arguments.

    In a reach a force pulls a marker (a point on a link) to a target.
    """

    def __init__(self) -> None:
        self.forces = function("law_forces", ADDRESS, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.client = function("law_client", ADDRESS, ADDRESS, ADDRESS)
        self.step = function("law_step", ADDRESS, ADDRESS, REAL, ADDRESS, ADDRESS, ADDRESS, ADDRESS)
        self.add_reaches = function("reach_add", ADDRESS, ADDRESS, INTEGER, ADDRESS, ADDRESS, REAL, ADDRESS)
        self.reach_is_approaching = function("reach_is_approaching", ADDRESS, ADDRESS, INTEGER, INTEGER, result=INTEGER)
        self.settle_check = function("settle_check", ADDRESS, ADDRESS, REAL, ADDRESS, INTEGER, result=INTEGER)


calls = cache(Calls)
"""Return the compiled functions of the law and of reaching (`Calls`); the library is loaded at the first call."""


@cache
def term_names() -> tuple[str, ...]:
    """Return the names of the forces that constrain the robot, in the order in which the compiled core (core/law.cpp) adds them.

    They are "limits", "constraints" and "collision". Spring, damping and the forces of clients and reaches are not among them.
    """
    name = function("law_term", INTEGER, result=ctypes.c_char_p)
    return tuple(term.decode() for term in takewhile(bool, map(name, count())))


@cache
def state_term_names() -> tuple[str, ...]:
    """Return the names of those forces of `term_names` that depend on the state of the control law, such as its velocity.

    The other forces of `term_names` depend only on q and the contacts.
    """
    needs_state = function("law_needs_state", INTEGER, result=INTEGER)
    return tuple(name for index, name in enumerate(term_names()) if needs_state(index))
