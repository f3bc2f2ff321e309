"""The egocentric model beside MuJoCo and python-fcl, on one core, turn by turn: poses per second, and the same contacts."""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

from experiments.options import positive_whole
from mobee_cli.errors import ENVIRONMENT, FAILED, UserError

_PICTURES = (".png", ".svg", ".pdf")


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
    return 0 if all(one["passed"] for one in result["requirements"] + result["agreement"]) else FAILED


def _figure(arguments: argparse.Namespace) -> int:
    from experiments.bench.model_cost import draw, empty_figure, measure
    from experiments.matplotlib_figure import MatplotlibMissing

    try:
        figure = empty_figure()  # before minutes of measuring
    except MatplotlibMissing as error:
        raise UserError(str(error), ENVIRONMENT) from None
    curves = measure(arguments.rounds or (3 if arguments.quick else 9))
    draw(figure, curves, arguments.figure)
    print(json.dumps(curves, indent=2) if arguments.json else arguments.figure)
    return 0


def picture(text: str) -> Path:
    """A file for a figure, as an argument."""
    path = Path(text)
    if path.suffix not in _PICTURES:
        raise argparse.ArgumentTypeError(f"{text!r} is no picture; valid endings: {', '.join(_PICTURES)}")
    if not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: there is no folder {str(path.parent)!r}; make it first")
    return path


def _objects(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= 1000):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 1000")
    return int(text)
