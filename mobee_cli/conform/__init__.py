# SPDX-License-Identifier: Apache-2.0
"""`mobee conform`: tests whether a robot_sim keeps the rules of the bus contract.

It acts as the controller of the robot_sim. The contract defines messages and calls, and how robot_sim answers them (docs/hardware.md).
"""

from __future__ import annotations

import argparse
import json
import logging
import signal
import textwrap
from collections.abc import Sequence

from mobee.errors import MobeeError
from mobee_cli.conform.checks import CHECKS, Check
from mobee_cli.conform.player import Broken, Player
from mobee_cli.connect import connected, endpoint
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_robot, robot_given
from services.common.config import ServiceConfig, nearest
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, OK
from services.common.identity import DEFAULT_ENDPOINT
from services.common.observe import alive
from services.common.rpc import CallFailed
from services.common.service import Service

_JOIN = 2.0  # s until tokens and streams arrive
_NOTES = """Run `mobee router` and your robot_sim, without a controller. The verb moves the
first motor of a part by about 5 degrees towards the middle of its range, again
and again, and for the check model-gone it arms all parts: be ready to switch a
real robot off. The contract: docs/hardware.md.
Exit code: 0 all rules are kept, 1 a rule is broken, 2 bad input, 3 no robot."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee conform` to the parser: endpoint, robot and choice of the checks."""
    parser.epilog = _NOTES
    text = "address of the router (default: %(default)s)"
    parser.add_argument("endpoint", nargs="?", type=endpoint, default=DEFAULT_ENDPOINT, metavar="ENDPOINT", help=text)
    add_robot(parser, "default: icub")
    parser.add_argument("--part", help="part that is moved (default: the first)")
    parser.add_argument("--only", action="append", metavar="CHECK", help=f"run this check only: {', '.join(one.name for one in CHECKS)}")
    parser.add_argument("--still", action="store_true", help="run only checks that arm no part")
    parser.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee conform`: run the checks, print their results, and return the exit code (0: all rules are kept, 1: one is broken)."""
    try:
        robot = robot_given(arguments)
        part = arguments.part or next(iter(robot.parts))
        robot.part(part)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    chosen = _chosen(arguments.only, arguments.still)
    with connected(arguments.endpoint) as session:
        present = alive(session)
        if "controller" in present:
            raise UserError("a controller is running, and conform plays the controller: end it, or name another endpoint", ENVIRONMENT)
        if "robot_sim" not in present:
            raise UserError(f"no robot_sim is alive at {arguments.endpoint}: its process declares alive/robot_sim/INSTANCE", ENVIRONMENT)
        with Service("controller", ServiceConfig(endpoint=arguments.endpoint), robot, session=session) as service:
            signal.signal(signal.SIGINT, signal.default_int_handler)  # the verb reports Ctrl-C
            logging.getLogger().setLevel(logging.CRITICAL)  # the verb itself prints what the user needs
            player = Player(service, robot)
            service.ready()
            player.until(lambda: bool(service.alive.get("robot_sim") and (player.ticks or player.refused)), _JOIN)
            results = [(check, broken(check, player, part)) for check in chosen]
    if arguments.json:
        print(json.dumps([{"check": check.name, "rule": check.rule, "broken": found} for check, found in results], indent=2))
    else:
        for check, found in results:
            print(f"{'BROKEN' if found else 'ok':<8}{check.name:<16}{check.rule}")
            print(
                "".join(f"{line}\n" for line in textwrap.wrap(found or "", 80, initial_indent=" " * 8, subsequent_indent=" " * 8)), end=""
            )
    return FAILED if any(found for _, found in results) else OK


def broken(check: Check, player: Player, part: str) -> str | None:
    """Run a check on a part. Returns None if the rule is kept, else a description of the violation."""
    try:
        check.test(player, part)
    except Broken as found:
        return str(found)
    except CallFailed as failed:
        return f"a call failed: {failed}"
    return None


def _chosen(names: Sequence[str] | None, still: bool) -> list[Check]:
    known = {check.name: check for check in CHECKS}
    for name in names or ():
        if name not in known:
            raise UserError(f"--only {name}: unknown check.{nearest(name, known)}", BAD_INPUT)
    return [check for check in CHECKS if check.name in (names or known) and not (still and check.moves)]
