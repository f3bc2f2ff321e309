# SPDX-License-Identifier: Apache-2.0
"""Starts a service with its log and its robot; on bad input, prints one line on standard error and ends the service."""

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
from services.common.exit_codes import BAD_INPUT, FAILED, OK
from services.common.session import BusUnreachable
from services.common.text import printable

HELD = "MOBEE_HELD"
"""Environment variable of a process that a launcher has started. It holds the instance of the router that the process may join and, if the
launcher has joined from another host, the process id of the launcher. The launcher writes a byte to the standard input of the process when
it may join."""


def wait_until_released() -> tuple[str, ...]:
    """If a launcher has started this service, wait until the services on which it depends are ready.

    Returns the words of the environment variable MOBEE_HELD, which the launcher sets. The first word is the id of the router's process on
    the bus. If the launcher runs on another host than the router, the second word is the launcher's process id. Without a launcher the
    result is (). Raises SystemExit if the launcher ends during the wait.
    """
    held = os.environ.pop(HELD, "").split()
    if held and not os.read(sys.stdin.fileno(), 1):
        raise SystemExit(OK)  # otherwise it would join beside the process that it should replace
    return tuple(held)


def robot_of(config: ServiceConfig) -> Robot:
    """Load the robot that the settings of a service name; raises MobeeError if it cannot be read, or the service cannot serve it."""
    robot = load_robot(config.robot)
    config.check_robot(robot)
    return robot


@contextmanager
def explained(prog: str) -> Iterator[None]:
    """If the `with` block raises an error of the project, print it as one line on standard error and exit.

    The exit code is 2 if a setting is wrong, otherwise 1. `prog`: name of the program that runs, for this line.
    """
    try:
        yield
    except (MobeeError, BusUnreachable) as error:
        print(f"{prog}: {error}", file=sys.stderr)
        raise SystemExit(BAD_INPUT if isinstance(error, (RobotFileError, UnknownName, InvalidValue)) else FAILED) from None


class _LogFile(logging.FileHandler):
    """The handler of a service's log file; if the disk is full, it drops lines."""

    def handleError(self, record: logging.LogRecord) -> None:
        """Drop a line if the disk is full, without the traceback of `logging`, which would cover the status screen."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handleError(record)


class _OneLine(logging.Formatter):
    """Formats each entry as one line, for any text: clients write some of the texts, for example the reason of a stop."""

    def formatMessage(self, record: logging.LogRecord) -> str:
        """Escape control characters; a traceback, which is added later, keeps its lines."""
        return printable(super().formatMessage(record))


def set_up_log(who: str, file: Path | None = None) -> logging.Logger:
    """Return the logger of the service `who`; it writes to `file`, or to standard error, which the launcher redirects to a file."""
    handler = logging.StreamHandler(sys.stderr) if file is None else _LogFile(file)
    handler.setFormatter(_OneLine(f"%(asctime)s.%(msecs)03d %(levelname)-7s {who} %(message)s", datefmt="%H:%M:%S"))
    logging.basicConfig(handlers=[handler], level=logging.INFO, force=True)
    return logging.getLogger(who)
