"""A finding of a check, and how findings format numbers and lists."""

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
    """What is wrong, where, why it matters and what to do.

    error: the robot cannot work as it is; warning: it will surprise its owner; note: good to know, may well be meant.
    """

    severity: Severity
    check: str  # short name of the check
    where: str  # "file:line"
    what: str
    why: str
    remedy: str


def interval(limits: Array, kind: str) -> str:
    """An interval given in rad or m, as a person says it."""
    low, high = np.rad2deg(limits) if kind == "revolute" else np.asarray(limits)
    return f"{low:.4g} to {high:.4g} {'deg' if kind == 'revolute' else 'm'}"


def motor_interval(robot: Robot, motor: Motor) -> str:
    """The interval of a motor in its own unit."""
    return interval(motor.limits, "prismatic" if _in_metres(robot, motor) else "revolute")


def position(robot: Robot, motor: Motor, value: float) -> str:
    """A position of a motor in its own unit, or how far two are apart."""
    return f"{1e3 * value:.3g} mm" if _in_metres(robot, motor) else f"{np.rad2deg(value):.3g} deg"


def _in_metres(robot: Robot, motor: Motor) -> bool:
    """Whether a motor counts in m: a slide, one joint of which is not geared."""
    return slides(robot, motor) and any(scale == 1.0 for _, scale, _ in motor.joints)


def length(metres: float) -> str:
    """A length in the unit in which it is easily read."""
    return f"{1e3 * metres:.3g} mm" if metres < 0.1 else f"{metres:.3g} m"


def some(names: Iterable[str], most: int = 4) -> str:
    """The first names of a list, and how many more there are."""
    listed = list(names)
    more = f" and {len(listed) - most} more" if len(listed) > most else ""
    return ", ".join(listed[:most]) + more


def count(things: Sized, noun: str) -> str:
    """A number of things."""
    return f"{len(things)} {noun}{'' if len(things) == 1 else 's'}"
