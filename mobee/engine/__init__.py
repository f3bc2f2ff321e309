"""The engine: kinematics, contacts and projected forces of one pose or of many, found by the core.

`engine_of(robot)` is all that most of the library needs; importing this package alone loads nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mobee.engine.engine import Engine
    from mobee.robot.robot import Robot


def engine_of(robot: Robot) -> Engine:
    """The engine of a robot; the first call of a process loads the core."""
    from mobee.engine.engine import Engine

    return Engine(robot)
