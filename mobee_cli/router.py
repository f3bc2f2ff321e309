# SPDX-License-Identifier: Apache-2.0
"""`mobee router`: runs only the router, for systems whose services are started one by one, as in containers."""

from __future__ import annotations

import argparse
import sys

from mobee_cli.errors import UserError
from services.common.config import ServiceConfig
from services.common.exit_codes import ENVIRONMENT
from services.common.service import Service
from services.common.session import DEFAULT_ENDPOINT, BusUnreachable, open_router


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the address."""
    parser.add_argument("--listen", default=DEFAULT_ENDPOINT, metavar="ADDRESS", help="address to listen at (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Route until SIGTERM, Ctrl-C or `mobee stop`."""
    try:
        session = open_router(arguments.listen)
    except BusUnreachable as error:
        raise UserError(str(error), ENVIRONMENT) from None
    if not any(host in arguments.listen for host in ("127.0.0.1", "localhost", "[::1]", "unixsock")):
        print("mobee router: every program that reaches this address can move the robot: keep it inside a trusted network", file=sys.stderr)
    with Service("router", ServiceConfig(endpoint=arguments.listen), session=session) as service:
        service.describe = lambda: (f"routes at {arguments.listen}", {})
        service.ready()
        service.run()
    return 0
