"""`mobee topic`: what is published on the bus."""

from __future__ import annotations

import argparse

from mobee_cli import topic_echo, topic_hz, topic_list
from mobee_cli.connect import add_endpoint, connected
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT

_ACTIONS = {"list": topic_list, "echo": topic_echo, "hz": topic_hz}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One parser an action."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="list|echo|hz")
    for name, module in _ACTIONS.items():
        text = (module.__doc__ or "").partition(": ")[2]
        action = actions.add_parser(name, description=text, help=text)
        add_endpoint(action)
        module.add_arguments(action)


def run(arguments: argparse.Namespace) -> int:
    """Connect and run the action."""
    with connected(arguments.endpoint) as session:
        try:
            return int(_ACTIONS[arguments.action].run(session, arguments))
        except ValueError as error:
            raise UserError(str(error), BAD_INPUT) from None
        except KeyboardInterrupt:
            if arguments.action == "list":
                raise
            return 0  # the way to end the others
