# SPDX-License-Identifier: Apache-2.0
"""`mobee roadmap`: roadmaps of whole-body poses, with the actions build, tasks, show, query and play."""

from __future__ import annotations

import argparse
import importlib

from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT

# Each action is a module of this package: DESCRIPTION, NOTES, `add_arguments(parser)`, and `run(arguments)`, which returns the exit code.
ACTIONS = {
    "build": "build the roadmap of a task",
    "tasks": "list the shipped tasks",
    "show": "describe a roadmap, and draw it",
    "query": "find a path through a roadmap",
    "play": "move the robot along such a path, offline or live",
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee roadmap` to the parser: one subcommand for each action."""
    actions = parser.add_subparsers(dest="action", required=True, metavar="|".join(ACTIONS))
    for name, text in ACTIONS.items():
        module = importlib.import_module(f"mobee_cli.roadmap.{name}")
        one = actions.add_parser(
            name, help=text, description=module.DESCRIPTION, epilog=module.NOTES, formatter_class=argparse.RawDescriptionHelpFormatter
        )
        one.add_argument("--json", action="store_true", help="print as JSON")
        module.add_arguments(one)


def run(arguments: argparse.Namespace) -> int:
    """Run the action of `mobee roadmap` that the arguments name, and return the exit code."""
    try:
        code: int = importlib.import_module(f"mobee_cli.roadmap.{arguments.action}").run(arguments)
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    return code
