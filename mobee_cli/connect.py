# SPDX-License-Identifier: Apache-2.0
"""Connects a subcommand of `mobee` to the running system."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT
from services.common.identity import DEFAULT_ENDPOINT, IDENTITY, KEYS, OPERATOR, BadKeys

PATIENCE = 0.3  # s: a system that runs answers at once


def add_endpoint(parser: argparse.ArgumentParser) -> None:
    """Add two options to a parser: --endpoint, the address of the router, and --keys, the keys of a secured system."""
    text = "address of the router (default: %(default)s)"
    parser.add_argument("--endpoint", type=endpoint, default=DEFAULT_ENDPOINT, metavar="ADDRESS", help=text)
    text = f"folder of keys of a secured system (default: ${KEYS}); the identity is {OPERATOR}, unless ${IDENTITY} names another"
    parser.add_argument("--keys", dest="operator_keys", metavar="DIR", help=text)


def endpoint(text: str) -> str:
    """Check the address of a router that a user gives, and return it. Raises ArgumentTypeError if Zenoh cannot use it."""
    protocol, _, place = text.partition("/")
    number = place.rpartition(":")[2]
    if not place or (protocol in ("tcp", "tls") and not (number.isdecimal() and 0 < int(number) < 65536)):
        raise argparse.ArgumentTypeError(
            f"{text!r} is no address of a router: write tcp/HOST:PORT with a port from 1 to 65535, such as {DEFAULT_ENDPOINT}"
        )
    return text


@contextmanager
def connected(endpoint: str, patience: float = PATIENCE) -> Iterator[Any]:
    """Open a session with the running system for the block of a `with` statement.

    `endpoint`: address of the router. Raises UserError if no system answers within `patience` s.
    """
    from services.common.session import BusUnreachable, open_client  # it needs zenoh, and `mobee doctor` works without

    try:
        session = open_client(endpoint, patience=patience)
    except (BusUnreachable, BadKeys) as error:
        raise UserError(str(error), ENVIRONMENT) from None
    with session:
        yield session
