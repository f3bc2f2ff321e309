# SPDX-License-Identifier: Apache-2.0
"""`mobee router`: runs only the router of the bus, for services that are started one by one."""

from __future__ import annotations

import argparse
import contextlib
import sys
from pathlib import Path
from typing import Any

from mobee_cli.connect import endpoint
from mobee_cli.errors import UserError
from services.common.access import access_list
from services.common.config import ServiceConfig
from services.common.emergency_stop import StopRecord
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT
from services.common.identity import DEFAULT_ENDPOINT, ROUTER, BadKeys, Identity, assume, default_folder, is_local, secured
from services.common.refusals import RefusalLog
from services.common.service import Service
from services.common.session import NAMESPACE, BusUnreachable, open_client, open_router
from services.launcher.security import Refusals


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee router` to the parser: address, keys and others."""
    text = "address to listen at (default: %(default)s)"
    parser.add_argument("--listen", type=endpoint, default=DEFAULT_ENDPOINT, metavar="ADDRESS", help=text)
    parser.add_argument(
        "--stop-record", type=Path, metavar="FILE", help="record of emergency stops that robot_sim reads: created if absent"
    )
    parser.add_argument("--secure", action="store_true", help="admit only processes with keys, each to what is its own")
    text = "folder of keys for --secure (default: the one that `mobee keys new` makes)"
    parser.add_argument("--keys", type=Path, metavar="DIR", help=text)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee router`: pass messages until SIGTERM, Ctrl-C or `mobee stop`, and return the exit code."""
    if arguments.keys is not None and not arguments.secure:
        raise UserError("--keys is for --secure: give both, or neither", BAD_INPUT)
    with contextlib.ExitStack() as opened:
        try:
            if arguments.stop_record is not None:
                StopRecord(arguments.stop_record).create()
            listens, session, refusals = _secured(arguments) if arguments.secure else _open(arguments.listen, opened)
        except OSError as error:
            raise UserError(f"{error.filename or arguments.stop_record} cannot be written: {error.strerror}", ENVIRONMENT) from None
        except (BusUnreachable, BadKeys) as error:
            raise UserError(str(error), ENVIRONMENT) from None
        with Service("router", ServiceConfig(endpoint=listens), session=session) as service:
            service.describe = lambda: (f"routes at {listens}", {})
            if refusals is not None:
                Refusals(service, refusals)
            service.ready()
            service.run()
    return 0


def _open(listens: str, opened: contextlib.ExitStack) -> tuple[str, Any, None]:
    """Open a router that admits every program, and a session with it. The exit of `opened` closes the router.

    Returns the address, the session, and None in place of the log of refusals, since nothing is refused.
    """
    opened.enter_context(open_router(listens))
    if not is_local(listens):
        print("mobee router: every program that reaches this address can move the robot: keep it inside a trusted network", file=sys.stderr)
    return listens, open_client(listens), None


def _secured(arguments: argparse.Namespace) -> tuple[str, Any, RefusalLog]:
    """Open a router that admits only programs with an identity in a folder of keys; return its address, session and log of refusals.

    The session is that of the router itself, because with the router's certificate no second session can connect.
    """
    from services.common.certificates import KeyFolder

    keys = KeyFolder((arguments.keys or default_folder()).resolve())
    keys.require([ROUTER])
    assume(None)
    refusals = RefusalLog.open()
    access = access_list({one.name: one.party for one in keys.issued() if one.party is not None}, NAMESPACE)
    listens = secured(arguments.listen)
    return listens, open_router(listens, identity=Identity(keys.path, ROUTER), access=access), refusals
