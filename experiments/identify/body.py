"""The robot that is identified: PyBullet's, with nothing else in its world."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from experiments.identify.signals import DT
from mobee import MotorParameters, World
from mobee.robot.robot import Robot
from services.robot_sim.backend import Backend, BackendUnavailable


def make_body(robot: Robot, seed: int) -> Backend:
    """With the motors that it has unless told otherwise; raises BackendUnavailable where there is no PyBullet."""
    try:
        from services.robot_sim.bullet import BulletBackend  # the only way to PyBullet, which not every Python has
    except ModuleNotFoundError as error:
        raise BackendUnavailable(
            f"identify needs the module {error.name!r}: pip install '.[sim]' in MoBeE's folder on Python 3.11."
        ) from error
    return BulletBackend(robot, World, MotorParameters(), seed, DT)


@contextmanager
def chatter_aside() -> Iterator[None]:
    """PyBullet prints a line on standard output for every scene, from C; it goes to standard error while entered."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        yield
    finally:
        os.dup2(kept, 1)
        os.close(kept)
