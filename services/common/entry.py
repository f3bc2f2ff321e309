"""Starts a service with its robot, and ends it with one line on bad input."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from mobee.errors import InvalidValue, MobeeError, RobotFileError, UnknownName
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from services.common.config import ServiceConfig
from services.common.exit_codes import BAD_INPUT, FAILED
from services.common.session import BusUnreachable

HELD = "MOBEE_HELD"  # set: standard input is a pipe that the launcher closes when the service may join the others


def wait_until_released() -> None:
    """Wait until the services that this one needs are ready, where the launcher has started it before they are."""
    if os.environ.pop(HELD, None) is not None:
        os.read(sys.stdin.fileno(), 1)  # the end of the file: nobody writes


def robot_of(config: ServiceConfig) -> Robot:
    """The robot of a service; raises MobeeError for one that cannot be read, or that the service cannot serve."""
    robot = load_robot(config.robot)
    config.check_robot(robot)
    return robot


@contextmanager
def explained(prog: str) -> Iterator[None]:
    """Turn the project's errors into one line on standard error; exit code 2 for a mistake in what was given, else 1."""
    try:
        yield
    except (MobeeError, BusUnreachable) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        raise SystemExit(BAD_INPUT if isinstance(error, (RobotFileError, UnknownName, InvalidValue)) else FAILED) from None
