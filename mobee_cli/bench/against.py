"""Another checkout beside this one, in one run: how much less processor time plant, agents, plans, maps and lockstep cost."""

from __future__ import annotations

import argparse
import json
import sys

from experiments.bench.against import LEAST
from experiments.kit.command_line import positive_whole
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("old", metavar="OLD", help="the other checkout: a folder, or a commit of this repository")
    parser.add_argument("--new", metavar="NEW", help="instead of this checkout")
    parser.add_argument(
        "--old-python", default=sys.executable, metavar="PYTHON", help="that runs it, with its libraries (default: this one)"
    )
    parser.add_argument("--cases", nargs="+", choices=LEAST, metavar="CASE", help=f"of {', '.join(map(repr, LEAST))} (default: all)")
    parser.add_argument("--rounds", type=positive_whole, default=5, metavar="N", help="runs of each case in each checkout (default: 5)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.against import HERE, checkout, measure, report

    with checkout(arguments.old, arguments.old_python) as old, checkout(arguments.new or str(HERE)) as new:
        result = measure(old, new, arguments.cases or tuple(LEAST), arguments.rounds)
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
