# SPDX-License-Identifier: Apache-2.0
"""Connects a verb to the running system."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT
from services.common.session import DEFAULT_ENDPOINT, BusUnreachable, open_client

_PATIENCE = 0.3  # s: a system that runs answers at once


def add_endpoint(parser: argparse.ArgumentParser) -> None:
    """Add the option for the address of the router."""
    parser.add_argument("--endpoint", default=DEFAULT_ENDPOINT, metavar="ADDRESS", help="address of the router (default: %(default)s)")


@contextmanager
def connected(endpoint: str) -> Iterator[Any]:
    """Open a session with the running system; raises UserError if there is none."""
    try:
        session = open_client(endpoint, patience=_PATIENCE)
    except BusUnreachable as error:
        raise UserError(str(error), ENVIRONMENT) from None
    with session:
        yield session
