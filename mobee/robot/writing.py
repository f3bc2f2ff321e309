# SPDX-License-Identifier: Apache-2.0
"""Functions of the writers of robot files: the motor of each joint, numbers as text without loss of precision, and whole files."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.robot import Robot


@dataclass(frozen=True, slots=True)
class Drive:
    """The drive of a joint by one motor: joint = scale * motor + offset; `motor`: index of the motor, `offset`: rad or m."""

    motor: int
    scale: float
    offset: float


def drives_of(robot: Robot) -> tuple[Drive, ...]:
    """Return the drive of every joint, in the order of the joints; raises InvalidValue if a joint has no motor or several motors."""
    drives: dict[int, Drive] = {}
    for column, motor in enumerate(robot.motor_table):
        for index, scale, offset in motor.joints:
            if index in drives:
                joint = robot.joints[index].name
                both = f"{robot.motors[drives[index].motor]!r} and {motor.name!r}"
                raise InvalidValue(f"joint {joint!r} is driven by {both}. Make two joints of it, on the same axis, one for each motor.")
            drives[index] = Drive(column, scale, offset)
    for index, idle in enumerate(robot.joints):
        if index not in drives:
            raise InvalidValue(f"joint {idle.name!r} is driven by no motor. Give it one, or make it part of the link that carries it.")
    return tuple(drives[index] for index in range(len(robot.joints)))


def write_whole(path: Path, content: bytes) -> Path:
    """Write a file completely or not at all, and return its path.

    The content is written into a temporary file in the same folder, which then replaces the file and has its mode. A symbolic link stays
    one: its target is replaced. Raises OSError with the name of `path`.
    """
    target = Path(os.path.realpath(path))
    beside = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        with beside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        if target.exists():
            shutil.copymode(target, beside)
        os.replace(beside, target)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error
    finally:
        with suppress(OSError):  # else it would hide the error above
            beside.unlink()
    return path


def number(value: float) -> str:
    """Return the shortest decimal text of a number from which float() gives exactly the same number."""
    return repr(float(value)) if value % 1 or abs(value) > 1e15 else str(int(value))


def numbers(values: Iterable[float]) -> str:
    """Return the shortest exact decimal texts of numbers, joined by blanks."""
    return " ".join(map(number, values))


def degrees(radians: float) -> str:
    """Return an angle [rad] as text in degrees, rounded to 9 decimals if this gives exactly the same angle [rad] when it is read."""
    exact = float(np.rad2deg(radians))
    rounded = round(exact, 9)
    return number(rounded if np.deg2rad(rounded) == radians else exact)
