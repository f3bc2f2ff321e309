"""Evolution strategies beside CMA-ES: how many evaluations each needs on rotated functions, from the same starts."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace

from experiments.kit.command_line import positive_whole
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="10 dimensions alone, 3 runs of each")
    parser.add_argument("--runs", type=positive_whole, metavar="N", help="runs of each function (default: 11)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.nes import QUICK, Settings, measure, report

    settings = QUICK if arguments.quick else Settings()
    result = measure(replace(settings, runs=arguments.runs or settings.runs))
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
