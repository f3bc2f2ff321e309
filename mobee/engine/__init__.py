"""The compiled engine: kinematics, contacts and projected forces of one pose or of many, over packed arrays.

`engine_of(robot)` is all that the rest of the library needs; importing this package alone compiles and imports nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from mobee.engine.engine import Engine
    from mobee.robot.robot import Robot


def engine_of(robot: Robot) -> Engine:
    """The engine of a robot; the first call of a process loads the machine code, the first after an install compiles it."""
    from mobee.engine.load import load

    load()
    from mobee.engine.engine import Engine

    return Engine(robot)
