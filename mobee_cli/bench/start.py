"""From import to the first pose, and from the start of the default system until it is ready: how long, and how much memory."""

from __future__ import annotations

import argparse
import json

from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="5 processes of each, one start of the system (default: 15 and 3)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.start import QUICK, Settings, measure, report

    result = measure(QUICK if arguments.quick else Settings())
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
