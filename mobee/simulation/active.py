"""Which motors of a plant live."""

from __future__ import annotations

from collections.abc import Sequence
from fnmatch import fnmatchcase

import numpy as np
from numpy.typing import NDArray

from mobee.errors import InvalidValue, UnknownName
from mobee.robot.robot import Robot


def living(robot: Robot, active: Sequence[str] | None) -> NDArray[np.bool_]:
    """Which motors (n,) are meant by names and patterns of parts and motors; all by None."""
    if active is None:
        return np.ones(len(robot.motors), dtype=bool)
    alive = np.zeros(len(robot.motors), dtype=bool)
    for pattern in [active] if isinstance(active, str) else active:
        found = [fnmatchcase(motor.name, pattern) or fnmatchcase(motor.part, pattern) for motor in robot.motor_table]
        if not any(found):
            raise UnknownName("part or motor", pattern, (*robot.parts, *robot.motors))
        alive |= np.array(found)
    if not alive.any():
        raise InvalidValue(f"active={active!r}: at least one part or motor must live; None means all.")
    return alive
