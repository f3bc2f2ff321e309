# SPDX-License-Identifier: Apache-2.0
"""`mobee router`: runs only the router, for systems whose services are started one by one, as in containers."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from mobee_cli.connect import endpoint
from mobee_cli.errors import UserError
from services.common.config import ServiceConfig
from services.common.emergency_stop import StopRecord
from services.common.exit_codes import ENVIRONMENT
from services.common.service import Service
from services.common.session import DEFAULT_ENDPOINT, BusUnreachable, open_client, open_router


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the address."""
    text = "address to listen at (default: %(default)s)"
    parser.add_argument("--listen", type=endpoint, default=DEFAULT_ENDPOINT, metavar="ADDRESS", help=text)
    parser.add_argument(
        "--stop-record", type=Path, metavar="FILE", help="record of emergency stops that robot_sim reads: created if absent"
    )


def run(arguments: argparse.Namespace) -> int:
    """Route until SIGTERM, Ctrl-C or `mobee stop`."""
    try:
        if arguments.stop_record is not None:
            StopRecord(arguments.stop_record).create()
        router = open_router(arguments.listen)
        session = open_client(arguments.listen)
    except OSError as error:
        raise UserError(f"{arguments.stop_record} cannot be written: {error.strerror}", ENVIRONMENT) from None
    except BusUnreachable as error:
        raise UserError(str(error), ENVIRONMENT) from None
    if not any(host in arguments.listen for host in ("127.0.0.1", "localhost", "[::1]", "unixsock")):
        print("mobee router: every program that reaches this address can move the robot: keep it inside a trusted network", file=sys.stderr)
    with router, Service("router", ServiceConfig(endpoint=arguments.listen), session=session) as service:
        service.describe = lambda: (f"routes at {arguments.listen}", {})
        service.ready()
        service.run()
    return 0
