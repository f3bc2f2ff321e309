# SPDX-License-Identifier: Apache-2.0
"""`mobee launch`: starts a scenario, keeps it running, and prints a summary at the end."""

from __future__ import annotations

import argparse
from pathlib import Path

from experiments.kit.command_line import positive_number, positive_whole
from mobee_cli.connect import endpoint
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_cameras
from services.common.exit_codes import BAD_INPUT
from services.common.identity import default_folder
from services.launcher.run import Options, launch
from services.launcher.scenario import shipped

_NOTES = """Shipped scenarios: {scenarios}.
Ctrl-C ends all processes, a second Ctrl-C kills them. The summary goes to
standard output, everything else to standard error."""


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the option --set."""
    text = "change a setting, such as services.model.contact_forces=false"
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="FIELD=VALUE", help=text)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scenario and the options."""
    parser.epilog = _NOTES.format(scenarios=", ".join(shipped()))
    parser.add_argument("scenario", nargs="?", default="default", help="shipped scenario, or path of a .toml file (default: default)")
    add_settings(parser)
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--headless", action="store_true", help="start without the page")
    shown.add_argument("--page", action="store_true", help="start with the page, also if the scenario has none, as kinematic and lockstep")
    parser.add_argument("--no-record", dest="record", action="store_false", help="start without the recorder of all messages")
    add_cameras(parser)
    parser.add_argument("--duration", type=positive_number, metavar="S", help="end S seconds after all services are ready")
    parser.add_argument("--ticks", type=positive_whole, metavar="N", help="lockstep only (shared.mode=lock): end after N ticks")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    text = "address of the router (default: the scenario's, or tcp/127.0.0.1:7447)"
    parser.add_argument("--endpoint", type=endpoint, metavar="ADDRESS", help=text)
    parser.add_argument("--secure", action="store_true", help="admit only processes with keys, each to what is its own")
    text = "folder of keys for --secure (default: the one that `mobee keys new` makes)"
    parser.add_argument("--keys", type=Path, metavar="DIR", help=text)
    text = "allow an ADDRESS that other hosts reach, without --secure: every program that reaches it can move the robot"
    parser.add_argument("--insecure", action="store_true", help=text)
    parser.add_argument("--runs", type=Path, default=Path("runs"), metavar="DIR", help="parent of the run's folder (default: runs)")


def run(arguments: argparse.Namespace) -> int:
    """Launch, and return at the end."""
    if arguments.keys is not None and not arguments.secure:
        raise UserError("--keys is for --secure: give both, or neither", BAD_INPUT)
    if arguments.secure and arguments.insecure:
        raise UserError("--secure and --insecure contradict each other: give one of them", BAD_INPUT)
    return launch(
        Options(
            scenario=arguments.scenario,
            settings=tuple(arguments.settings),
            headless=arguments.headless,
            page=arguments.page,
            record=arguments.record,
            cameras=tuple(arguments.cameras),
            duration=arguments.duration,
            ticks=arguments.ticks,
            json=arguments.json,
            endpoint=arguments.endpoint,
            runs=arguments.runs,
            keys=(arguments.keys or default_folder()) if arguments.secure else None,
            insecure=arguments.insecure,
        )
    )
