"""The offline plant on one core: one arm and three agents at the table, MuJoCo's stepper beside them, and the same hash twice."""

from __future__ import annotations

import argparse
import json

from mobee_cli.bench.drawn import draw_costs, picture
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--quick", action="store_true", help="one short round")
    parser.add_argument("--figure", type=picture, metavar="FILE", help="draw cost against tick and objects instead (.png, .svg, .pdf)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    if arguments.figure:
        return _figure(arguments)
    from experiments.bench.plant import QUICK, Settings, measure, report

    result = measure(QUICK if arguments.quick else Settings())
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED


def _figure(arguments: argparse.Namespace) -> int:
    from experiments.bench.plant_cost import draw, empty_figure, measure

    return draw_costs(arguments, empty_figure, lambda: measure(10 if arguments.quick else 100), draw)
