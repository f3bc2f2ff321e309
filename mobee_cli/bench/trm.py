"""The pre-grasp map of thesis figure 4.8, by least squares and by the evolution strategy: how soon, how complete, whether it is valid."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace

from experiments.kit.command_line import positive_whole
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="30 mm instead of 8 between poses")
    parser.add_argument("--seeds", type=positive_whole, metavar="N", help="maps of each method, of which the worst counts (default: 1)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.trm import QUICK, Settings, measure, report

    settings = QUICK if arguments.quick else Settings()
    result = measure(replace(settings, seeds=arguments.seeds or settings.seeds))
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
