"""What a benchmark draws: cost against size, instead of its table."""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT

_PICTURES = (".png", ".svg", ".pdf")


def picture(text: str) -> Path:
    """A file for a figure, as an argument."""
    path = Path(text)
    if path.suffix not in _PICTURES:
        raise argparse.ArgumentTypeError(f"{text!r} is no picture; valid endings: {', '.join(_PICTURES)}")
    if not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: there is no folder {str(path.parent)!r}; make it first")
    return path


def draw_costs(
    arguments: argparse.Namespace,
    empty_figure: Callable[[], Any],
    measure: Callable[[], dict[str, Any]],
    draw: Callable[[Any, dict[str, Any], Path], None],
) -> int:
    """Measure, draw into the file asked for, and print its name, or the numbers as JSON; returns the exit code."""
    from experiments.kit.plots import MatplotlibMissing

    try:
        figure = empty_figure()  # before minutes of measuring
    except MatplotlibMissing as error:
        raise UserError(str(error), ENVIRONMENT) from None
    curves = measure()
    draw(figure, curves, arguments.figure)
    print(json.dumps(curves, indent=2) if arguments.json else arguments.figure)
    return 0
