# SPDX-License-Identifier: Apache-2.0
"""`mobee film`: makes a film of a recorded run."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from mobee.errors import InvalidValue, MobeeError, NotInstalled
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT
from services.monitor.film.film import film

_NOTES = """The film takes 20 s: four stretches of the run, from its begin to its end, at
twice the robot's speed, with the stories of up to three agents."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee film` to the parser: the folder of the run, and the file to write."""
    parser.epilog = _NOTES
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run that had a monitor")
    parser.add_argument("--to", type=Path, metavar="FILE", help="film.gif or film.mp4 (default: film.gif in the folder)")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee film`: draw the film, write it, and return the exit code."""
    folder: Path = arguments.run
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder; runs of `mobee launch` are in runs/", BAD_INPUT)
    file: Path = arguments.to or folder / "film.gif"
    try:
        film(folder, file, _show if sys.stderr.isatty() else lambda share: None)
    except NotInstalled:
        raise
    except InvalidValue as error:
        raise UserError(str(error), BAD_INPUT) from None
    except MobeeError as error:
        raise UserError(str(error)) from None
    print(f"{file}: {file.stat().st_size / 1e6:.1f} MB")
    return 0


def _show(share: float) -> None:
    print(f"\rfilm: {100 * share:.0f} %", end="\n" if share == 1.0 else "", file=sys.stderr, flush=True)
