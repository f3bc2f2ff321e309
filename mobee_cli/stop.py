# SPDX-License-Identifier: Apache-2.0
"""`mobee stop`: ends the running system in an orderly manner."""

from __future__ import annotations

import argparse
import time
from typing import Any

from bus_schema import keys
from bus_schema.rpc import Done, Empty
from mobee_cli.connect import add_endpoint, connected
from mobee_cli.errors import UserError
from services.common import rpc
from services.common.observe import alive

_PATIENCE = 30.0  # s
_START = 2.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee stop` to the parser."""
    add_endpoint(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee stop`: ask the launcher to end everything, wait until it has ended, and return the exit code.

    If there is no launcher, ask every service, and then the router, to end.
    """
    with connected(arguments.endpoint) as session:
        present = alive(session)
        names = ["launcher"] if "launcher" in present else sorted(set(present) - {"router"}) + ["router"]
        for who in names:
            _ask_to_end(session, who)
        _wait_until_gone(session, names[-1])
    print("stopped")
    return 0


def _ask_to_end(session: Any, who: str) -> None:
    """Ask a service to end; repeat for a while if it does not answer, as it may be starting."""
    give_up = time.monotonic() + _START
    while True:
        try:
            rpc.call(session, "mobee", keys.service_rpc(who, "shutdown"), Empty, Done, timeout=_START)
            return
        except rpc.CallFailed as failed:
            if failed.code != "no_answer" or time.monotonic() > give_up:
                raise UserError(f"{who} did not accept the request: {failed}") from None
        time.sleep(0.1)


def _wait_until_gone(session: Any, who: str) -> None:
    """Wait until a service is gone: the launcher or the router, with which the connection ends too."""
    give_up = time.monotonic() + _PATIENCE
    while who in alive(session):
        if time.monotonic() > give_up:
            raise UserError(f"{who} has not ended after {_PATIENCE:g} s; kill its process, whose number `mobee status` shows")
        time.sleep(0.1)
