"""`mobee roadmap`: maps of whole-body motions: build, show, query, play."""

from __future__ import annotations

import argparse
import importlib

from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT

# One module of this package an action: `add_arguments(parser)`, and `run(arguments)`, which returns the exit code.
ACTIONS = {
    "build": "search for the poses of a task, and keep them as a map",
    "tasks": "those that come with mobee",
    "show": "what is in a map, in words and as a picture",
    "query": "the way through a map to a place of its task",
    "play": "move the robot there, offline or the one that runs",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One parser an action."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="|".join(ACTIONS))
    for name, text in ACTIONS.items():
        module = importlib.import_module(f"mobee_cli.roadmap.{name}")
        one = actions.add_parser(
            name, help=text, description=module.__doc__, epilog=module.NOTES, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        one.add_argument("--json", action="store_true", help="print as JSON")
        module.add_arguments(one)


def run(arguments: argparse.Namespace) -> int:
    """Do the action."""
    try:
        code: int = importlib.import_module(f"mobee_cli.roadmap.{arguments.action}").run(arguments)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    return code
