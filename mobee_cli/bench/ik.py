"""Inverse kinematics of a palm among boxes beside mink, CMA-ES, simulated annealing, a particle filter: how often, how soon."""

from __future__ import annotations

import argparse
import json

from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="20 targets, 5 for all motors and for the rivals (default: 300, 60, 40)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.ik import QUICK, Settings, measure, report

    result = measure(QUICK if arguments.quick else Settings())
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED
