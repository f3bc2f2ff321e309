# SPDX-License-Identifier: Apache-2.0
"""`mobee record`: records the messages of a running system, in addition to the recorder that the launcher starts."""

from __future__ import annotations

import argparse
import json
import os
import sys
from pathlib import Path
from typing import Any

from mobee.errors import MobeeError
from mobee_cli.connect import add_endpoint
from mobee_cli.errors import UserError
from services.common.config import ConfigError, convert
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT
from services.common.session import NAMESPACE, BusUnreachable
from services.recorder.files import parts_of

_NOTES = """`mobee launch` records by itself, into the folder of the run. This verb records
any other system, such as one whose services were started one by one, until
Ctrl-C. Foxglove and Rerun open the files; `mobee replay` plays them again, if
robot_sim ran when the recording began."""


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
    if parts_of(folder):
        raise UserError(f"{folder} holds a recording already, {parts_of(folder)[0].name}: name another folder with --to", BAD_INPUT)
    settings = {name: getattr(arguments, name) for name in ("endpoint", "namespace", "robot", "largest", "everything")}
    try:
        config = convert({**settings, "run_dir": str(folder)}, Config, lambda field: f"--{field}")
        files = _settings(arguments.endpoint, arguments.namespace)
        print(f"recording {arguments.endpoint} to {folder}/messages-*.mcap; Ctrl-C ends it", flush=True)
        record(f"mobee_record_{os.getpid()}", config, files)
    except BusUnreachable as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except (MobeeError, ConfigError) as error:
        raise UserError(str(error), BAD_INPUT) from None
    return 0


def _settings(endpoint: str, namespace: str) -> dict[str, bytes]:
    """Return the settings of all running services as files of TOML, by name, as `mobee launch` writes them; `mobee replay` needs them.

    Raises BusUnreachable.
    """
    from bus_schema import keys
    from bus_schema.rpc import Config, Empty
    from services.common import rpc
    from services.common.observe import alive
    from services.common.session import open_client
    from services.launcher.run_directory import to_toml

    found = {}
    with open_client(endpoint, namespace=namespace) as session:
        for who in alive(session):
            if who == "router" or who.startswith("launcher"):
                continue
            try:
                answer = rpc.call(session, "mobee", keys.service_rpc(who, "config"), Empty, Config, timeout=1.0, tries=2)
            except rpc.CallFailed:  # of a program that has no settings
                continue
            given: dict[str, Any] = json.loads(answer.config)
            found[f"{who}.toml"] = to_toml(given).encode()
    if "robot_sim.toml" not in found:
        print("mobee record: no robot_sim answers, so `mobee replay` cannot play this recording: start it first", file=sys.stderr)
    return found
