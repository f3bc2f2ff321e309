"""Starts a service with its log and its robot, and ends it with one line on bad input."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

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


class _LogFile(logging.FileHandler):
    """A file of log lines."""

    def handleError(self, record: logging.LogRecord) -> None:
        """A line that the disk has no room for is lost: told without logging's traceback, which would cover the screen."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handleError(record)


def set_up_log(who: str, file: Path | None = None) -> logging.Logger:
    """The service's logger; `file` instead of standard error."""
    logging.basicConfig(
        handlers=[logging.StreamHandler(sys.stderr) if file is None else _LogFile(file)],
        level=logging.INFO,
        format=f"%(asctime)s.%(msecs)03d %(levelname)-7s {who} %(message)s",
        datefmt="%H:%M:%S",
        force=True,
    )
    return logging.getLogger(who)
