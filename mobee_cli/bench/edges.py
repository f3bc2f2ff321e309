"""The edges of a map with thousands of vertices: how long it takes to check them all, and those near a change of the world."""

from __future__ import annotations

import argparse
import json

from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="a map of 500 vertices, one round (default: 5000, 5 rounds)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.edges import QUICK, Settings, measure, report

    result = measure(QUICK if arguments.quick else Settings())
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
