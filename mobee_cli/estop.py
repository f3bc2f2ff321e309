# SPDX-License-Identifier: Apache-2.0
"""`mobee estop`: stops the robot at once, or releases it again."""

from __future__ import annotations

import argparse
import logging
import sys
import time
from typing import Any

from bus_schema import keys
from bus_schema.messages import EStop, State
from bus_schema.rpc import Done, Empty
from mobee_cli.connect import add_endpoint, connected
from mobee_cli.errors import UserError
from services.common import rpc
from services.common.bus import Bus
from services.common.emergency_stop import SILENCE, StopLine, StopRecord, StopSender
from services.common.exit_codes import ENVIRONMENT
from services.common.observe import Received, alive, listen

_REPEAT, _PATIENCE, _CONNECT_PATIENCE = 0.1, 5.0, 2.0  # s; a machine under attack is slow


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee estop` to the parser."""
    add_endpoint(parser)
    parser.add_argument("--reset", action="store_true", help="release the robot: the controller and the agents continue at once")
    parser.add_argument("--reason", default="asked for at the terminal", help="text for the event log (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee estop`: send the emergency stop or its release, wait until the robot confirms it, and return the exit code."""
    if arguments.reset:
        _release(arguments.endpoint)
        return 0
    reason = arguments.reason[:2000]
    recorded = _recorded(arguments.endpoint, reason)  # before the connection, which may take long in a flood
    with StopSender(arguments.endpoint, "mobee", reason) as sender:
        sender.send()
        try:
            with connected(arguments.endpoint, _CONNECT_PATIENCE) as session:
                stopped = _stop(session, sender, reason)
        except UserError as error:
            if error.code == ENVIRONMENT and (kept := _kept(sender, recorded)):  # there is no router
                raise UserError(f"{error} {kept}", ENVIRONMENT) from None
            raise
    print(f"stopped: {stopped}; `mobee estop --reset` releases the robot")
    return 0


def _release(endpoint: str) -> None:
    with connected(endpoint, _CONNECT_PATIENCE) as session:
        try:
            rpc.call(session, "mobee", keys.ESTOP_RESET, Empty, Done, timeout=2.0)
        except rpc.CallFailed as failed:
            raise UserError(f"the robot was not released: {failed}") from None
    print("released: the controller arms the parts again, and running agents continue")


def _recorded(endpoint: str, reason: str) -> bool:
    """Record the stop if the robot was launched on this machine, and return whether it was; print why if the file cannot be written."""
    try:
        return StopRecord.of_endpoint(endpoint).stop("mobee", reason)
    except OSError as error:
        print(f"mobee estop: the stop is sent, but not recorded: {error.filename} cannot be written: {error.strerror}", file=sys.stderr)
        return False


def _kept(sender: StopSender, recorded: bool) -> str:
    """Send the stop once more past the router, and return what is known about it, as a text; empty if nothing is."""
    sender.send()
    time.sleep(_REPEAT)
    if sender.is_confirmed():
        return "robot_sim confirms the stop."
    return "The stop is recorded: robot_sim obeys the record if it still runs, and comes up stopped if it does not." if recorded else ""


def _stop(session: Any, sender: StopSender, reason: str) -> str:
    """Repeat the stop until every part of the robot reports it; return what has stopped, as a text.

    No part publishes its state in a pause, and while lockstep waits. Then the stop is repeated until robot_sim confirms it. Raises
    UserError if a part does not report the stop in time, or if no part publishes its state and robot_sim does not confirm the stop.
    """
    stopped: dict[str, bool] = {}  # by part; never False again: a repetition after a release would undo it
    begin = heard = time.monotonic()  # `heard`: of the newest state of any part

    def note(received: Received) -> None:
        nonlocal heard
        heard, part = received.at, received.key.partition("/")[0]
        stopped[part] = stopped.get(part, False) or received.content()["gate"] == "estop"

    listen(session, State.stream.keys(), note)
    line, is_confirmed = StopLine(session), False
    publisher = Bus(session, "mobee", logging.getLogger("mobee")).publisher(EStop)
    while time.monotonic() < begin + _PATIENCE:
        publisher.put(set=True, source="mobee", reason=reason)
        sender.send()
        time.sleep(_REPEAT)
        seen = dict(stopped)
        if seen and all(seen.values()):
            return ", ".join(sorted(seen))
        is_confirmed |= sender.is_confirmed() or any(stop.src == "robot_sim" for stop in line.take())
        if is_confirmed and time.monotonic() > heard + SILENCE:
            return "all parts, as robot_sim confirms (no part publishes its state, as in a pause)"
    moving = [part for part, is_stopped in stopped.items() if not is_stopped]
    result = f"{', '.join(moving)} did not stop" if moving else "no part of a robot publishes its state"
    kept = ". The launcher keeps the stop: robot_sim comes up stopped" if "launcher" in alive(session) else ""
    raise UserError(f"the stop was sent for {_PATIENCE:g} s, but {result}: use the robot's own emergency button{kept}")
