"""The egocentric model beside MuJoCo and python-fcl, on one core, turn by turn: poses per second, and the same contacts."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace

from experiments.kit.command_line import positive_whole
from mobee_cli.bench.drawn import draw_costs, picture
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument(
        "--objects",
        type=_objects,
        nargs="+",
        default=[0, 10, 100, 1000],
        metavar="N",
        help="boxes, 0 to 1000 each (default: 0 10 100 1000)",
    )
    parser.add_argument("--rounds", type=positive_whole, metavar="N", help="turns of everything that is timed (default: 15)")
    parser.add_argument("--quick", action="store_true", help="5 rounds of 500 poses, 50 poses to compare")
    parser.add_argument(
        "--figure", type=picture, metavar="FILE", help="draw cost against objects and primitives instead (.png, .svg, .pdf)"
    )


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    return _figure(arguments) if arguments.figure else _model(arguments)


def _model(arguments: argparse.Namespace) -> int:
    from experiments.bench.model import QUICK, Settings, measure
    from experiments.bench.model_report import report

    settings = QUICK if arguments.quick else Settings()
    boxes = tuple(sorted(set(arguments.objects)))
    compared = tuple(count for count in settings.compared_boxes if count in boxes)
    result = measure(replace(settings, boxes=boxes, compared_boxes=compared, rounds=arguments.rounds or settings.rounds))
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED


def _figure(arguments: argparse.Namespace) -> int:
    from experiments.bench.model_cost import draw, empty_figure, measure

    return draw_costs(arguments, empty_figure, lambda: measure(arguments.rounds or (3 if arguments.quick else 9)), draw)


def _objects(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= 1000):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 1000")
    return int(text)
