"""The live processes in lockstep: how much faster than real time, on the motor model alone and on PyBullet."""

from __future__ import annotations

import argparse
import json

from experiments.kit.command_line import positive_number
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument(
        "--seconds", type=positive_number, default=20.0, metavar="S", help="how long each of the four runs lasts (default: 20)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.lockstep import measure, report

    result = measure(arguments.seconds)
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
