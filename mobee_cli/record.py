# SPDX-License-Identifier: Apache-2.0
"""`mobee record`: records the messages of a running system, in addition to the recorder that the launcher starts."""

from __future__ import annotations

import argparse
import os
from pathlib import Path

from msgspec import ValidationError, convert

from mobee.errors import MobeeError
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT
from services.common.session import NAMESPACE, BusUnreachable

_NOTES = """`mobee launch` records by itself, into the folder of the run. This verb records
any other system, such as one whose services were started one by one, until
Ctrl-C. Foxglove and Rerun open the files; `mobee replay` plays them again."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee record` to the parser: folder, robot, largest size of the files, and others."""
    parser.epilog = _NOTES
    add_endpoint(parser)
    parser.add_argument("--to", type=Path, default=Path("."), metavar="DIR", help="folder of the files (default: the working directory)")
    parser.add_argument("--robot", default="icub", metavar="ROBOT", help="shipped robot, or path of its file (default: %(default)s)")
    parser.add_argument("--largest", type=float, default=2000.0, metavar="MB", help="size of all files (default: %(default)g)")
    parser.add_argument("--everything", action="store_true", help="record also what is published for subscribers only, such as pictures")
    parser.add_argument("--namespace", default=NAMESPACE, help="prefix of all keys (default: %(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee record`: record messages until Ctrl-C, and return the exit code."""
    from services.recorder.__main__ import record
    from services.recorder.config import Config

    folder: Path = arguments.to
    if not folder.is_dir():
        raise UserError(f"{folder}: there is no such folder", BAD_INPUT)
    print(f"recording {arguments.endpoint} to {folder}/messages-*.mcap; Ctrl-C ends it", flush=True)
    settings = {name: getattr(arguments, name) for name in ("endpoint", "namespace", "robot", "largest", "everything")}
    try:
        record(f"mobee_record_{os.getpid()}", convert({**settings, "run_dir": str(folder)}, Config))
    except BusUnreachable as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except (MobeeError, ValidationError) as error:
        raise UserError(str(error), BAD_INPUT) from None
    return 0
