# SPDX-License-Identifier: Apache-2.0
"""`mobee replay`: shows the page of a run again."""

from __future__ import annotations

import argparse
from pathlib import Path

from mobee.errors import MobeeError
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT

_NOTES = """The page shows what it showed during the run, with a time line below. The verb
prints its address, and ends with Ctrl-C."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the run and the port."""
    parser.epilog = _NOTES
    parser.add_argument("run", type=Path, metavar="RUN", help="folder of a run that had a monitor")
    parser.add_argument("--port", type=int, default=9091, help="port of the page (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C."""
    folder: Path = arguments.run
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder; runs of `mobee launch` are in runs/", BAD_INPUT)
    try:
        from services.monitor.replay import replay  # needs the viewer, which is an extra
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "rerun":
            raise
        raise UserError('a replay needs rerun-sdk: pip install "mobee[viz]"', ENVIRONMENT) from None
    try:
        replay(folder, arguments.port, lambda address: print(f"{folder.name} at {address}\nCtrl-C ends it.", flush=True))
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None
    except KeyboardInterrupt:
        pass
    return 0
