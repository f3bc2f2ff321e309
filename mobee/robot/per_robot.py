"""Caches what is computed once for a robot, as long as the robot lives."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from mobee.robot.robot import Robot

T = TypeVar("T")


def per_robot(build: Callable[[Robot], T]) -> Callable[[Robot], T]:
    """Call `build` once for each robot object; what it returned is not to be changed."""
    kept: WeakKeyDictionary[Robot, T] = WeakKeyDictionary()

    @wraps(build)
    def found(robot: Robot) -> T:
        known = kept.get(robot)
        if known is None:
            known = kept[robot] = build(robot)
        return known

    return found
