# SPDX-License-Identifier: Apache-2.0
"""A finding of a check, and the formatting of numbers and lists in findings."""

from __future__ import annotations

from collections.abc import Iterable, Sized
from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.robot.motor_units import slides
from mobee.robot.robot import Motor, Robot

Severity = Literal["error", "warning", "note"]
SEVERITIES: tuple[Severity, ...] = ("error", "warning", "note")


@dataclass(frozen=True, slots=True)
class Finding:
    """One problem of a file.

    `severity`: "error": the robot cannot work; "warning": it will behave unexpectedly; "note": useful to know, and possibly intended.
    `check`: short name of the check. `where`: "file:line". `what`: the fault. `why`: its effect. `remedy`: what the user should do.
    """

    severity: Severity
    check: str
    where: str
    what: str
    why: str
    remedy: str


def interval(limits: Array, kind: str) -> str:
    """Return an interval as text for a message, in degrees or m.

    `limits`: (2,) rad if `kind` is "revolute", (2,) m if it is "prismatic".
    """
    low, high = np.rad2deg(limits) if kind == "revolute" else np.asarray(limits)
    return f"{low:.4g} to {high:.4g} {'deg' if kind == 'revolute' else 'm'}"


def motor_interval(robot: Robot, motor: Motor) -> str:
    """Return the limits of a motor as text for a message, in degrees or, for a motor that slides, in m."""
    return interval(motor.limits, "prismatic" if _in_metres(robot, motor) else "revolute")


def position(robot: Robot, motor: Motor, value: float) -> str:
    """Return a position of a motor, or a difference of two positions, as text: in degrees or, for a motor that slides, in mm.

    `value`: rad or m.
    """
    return f"{1e3 * value:.3g} mm" if _in_metres(robot, motor) else f"{np.rad2deg(value):.3g} deg"


def _in_metres(robot: Robot, motor: Motor) -> bool:
    """Return whether the unit of a motor is m: it drives a sliding joint with scale 1."""
    return slides(robot, motor) and any(scale == 1.0 for _, scale, _ in motor.joints)


def length(metres: float) -> str:
    """Return a length [m] as text for a message, in mm if it is below 0.1 m, else in m."""
    return f"{1e3 * metres:.3g} mm" if metres < 0.1 else f"{metres:.3g} m"


def some(names: Iterable[str], most: int = 4) -> str:
    """Return the first `most` names of a list as text for a message, and the number of further names: "a, b, c, d and 3 more"."""
    listed = list(names)
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def count(things: Sized, noun: str) -> str:
    """Return the number of items with their noun as text for a message: "1 motor", "3 motors"."""
    return f"{len(things)} {noun}{'' if len(things) == 1 else 's'}"
