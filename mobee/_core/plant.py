# SPDX-License-Identifier: Apache-2.0
"""Simulated motors, and the control loop of a simulated robot (the offline plant): declares core/motors.cpp and core/plant.cpp."""

from __future__ import annotations

import ctypes
from functools import cache

import numpy as np

from mobee._core import ADDRESS, BYTES, INTEGER, INTERVAL, REAL, WHOLE, View, columns, function, law

CONSTANTS = columns(
    "low", "high", "max_velocity", "max_acceleration", "max_torque", "response", "half_backlash", "friction", whole=("delay",)
)  # fmt: skip
STATE = columns(
    "q",
    "velocity",
    "effort",
    "motor_q",
    "motor_velocity",
    "pulled_q",
    "hold_q",
    "reference",
    "load",
    "applied_torque",
    whole=("mode", "holding"),
)
MODES = ("position", "velocity", "torque", "hold")
PART = np.dtype([("motors", INTERVAL), ("under_way", WHOLE), ("verdict", WHOLE), ("start", "f8"), ("next_check", "f8")])
"""The type of a part and its action, `PartAction` of core/plant.cpp: its motors, whether an action is under way, how the last action ended
(`verdict`), and the times of the settle test [s]."""
RECORD_DEPTHS = 2
ALL_TICKS_DONE, ACTION_ENDED, STATE_LOST = range(3)


class Motors(ctypes.Structure):
    """The motors of a simulated robot, with the memory layout of the compiled core (`Motors` of core/motors.hpp).

    The structure has the addresses of tables; the caller keeps these tables alive.
    """

    _fields_ = (
        ("living", View), ("constants", View), ("state", ADDRESS), ("line", ADDRESS), ("rows", INTEGER), ("newest", INTEGER),
        ("seed", ctypes.c_uint64), ("noise_samples", ADDRESS), ("noise_tick", INTEGER),
    )  # fmt: skip


class Braking(ctypes.Structure):
    """The tables with which the core limits the commands of n motors so that they can always brake before their limits.

    `count`: n. `lower`, `upper`: limits of the positions [rad]. `fastest`: largest velocities [rad/s]. `change`: largest changes of the
    velocity in a tick [rad/s]. `velocity`: commanded velocities [rad/s]. These five are addresses of arrays (n,), which the caller keeps
    alive. `dt`: duration of a tick [s].
    """

    _fields_ = (
        ("count", INTEGER), ("lower", ADDRESS), ("upper", ADDRESS), ("fastest", ADDRESS), ("change", ADDRESS), ("velocity", ADDRESS),
        ("dt", REAL),
    )  # fmt: skip


class Plant(ctypes.Structure):
    """A plant (simulated robot under the control law), with the memory layout of the compiled core (`Plant` of core/plant.cpp).

    The structure has the addresses of other structures and of arrays; the caller keeps all of them alive.
    """

    _fields_ = (
        *((name, ADDRESS) for name in ("neighbours", "law", "law_state", "attractor", "client", "forces")),
        ("rows", INTEGER), ("reaches", View),
        ("motors", ADDRESS), ("commands", ADDRESS), ("command_age", INTEGER), ("substeps", INTEGER), ("dt", REAL),
        ("noise", ADDRESS), ("parts", View),
        *((name, ADDRESS) for name in ("q", "torque", "total", "record", "deepest")),
        *((name, INTEGER) for name in ("ticks", "max_ticks", "ticks_run", "end")),
    )  # fmt: skip


STRUCTURES = (
    law.MOTOR_GAINS, law.CLAUSE_ROW, law.CLAUSE_ENTRY, law.STATE, law.Law, law.DRIVE, law.JOINT, law.PULLED, law.Reach,
    CONSTANTS, STATE, Motors, PART, Plant,
)  # fmt: skip
"""All structures that are declared both in Python and in the core; a test compares their sizes."""


class Calls:
    """The compiled functions of motors and plants, as attributes; core/motors.cpp and core/plant.cpp document their arguments."""

    def __init__(self) -> None:
        self.enter = function("motors_enter", ADDRESS, INTEGER, INTEGER)
        self.drive = function("motors_drive", ADDRESS, REAL)
        self.move = function("motors_move", ADDRESS, INTEGER, REAL)
        self.adopt = function("motors_adopt", ADDRESS, ADDRESS, REAL)
        self.read = function("motors_read", ADDRESS, INTEGER, ADDRESS, ADDRESS)
        self.to_velocity = function("braking_to_velocity", ADDRESS, ADDRESS, ADDRESS)
        self.to_position = function("braking_to_position", ADDRESS, ADDRESS, ADDRESS)
        self.runs_out = function("braking_runs_out", ADDRESS, ADDRESS, ADDRESS, result=ctypes.c_bool)
        self.run = function("plant_run", ADDRESS)
        self.run_many = function("plants_run", BYTES, INTEGER, INTEGER)
        self.run_for = function("plants_run_for", BYTES, INTEGER, INTEGER, INTEGER)
        self.read_many = function("plants_read", BYTES, INTEGER, ADDRESS)
        self.aim_many = function("plants_aim", BYTES, INTEGER, BYTES)
        self.sizes = function("plant_sizes", ADDRESS)


calls = cache(Calls)
"""Return the compiled functions of motors and plants (`Calls`); the library is loaded at the first call."""
