# SPDX-License-Identifier: Apache-2.0
"""`mobee launch`: starts a scenario, supervises it until it ends, and prints a summary."""

from __future__ import annotations

import argparse
import re
import socket
from pathlib import Path

from experiments.kit.command_line import positive_number, positive_whole
from mobee_cli.connect import endpoint
from mobee_cli.errors import UserError
from mobee_cli.robot_options import add_cameras
from services.common.exit_codes import BAD_INPUT
from services.common.identity import default_folder
from services.launcher.run import Options, launch
from services.launcher.scenario import shipped

_NOTES = """Shipped scenarios:
{scenarios}.
Ctrl-C ends all processes, a second Ctrl-C kills them. The summary goes to
standard output, everything else to standard error."""


def add_settings(parser: argparse.ArgumentParser) -> None:
    """Add the option --set, which changes a setting of a scenario, to a parser."""
    text = "change a setting, such as services.model.contact_forces=false"
    parser.add_argument("--set", dest="settings", action="append", default=[], metavar="FIELD=VALUE", help=text)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee launch` to the parser: the scenario and others."""
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
    hosts = parser.add_argument_group("several hosts", "The first names what others start, and the others join it (docs/hosts.md).")
    text = "services that another host starts, which joins this one; they are waited for, and reported with their host"
    hosts.add_argument("--elsewhere", type=_names, default=(), metavar="SERVICE,..", help=text)
    hosts.add_argument("--join", type=endpoint, metavar="ADDRESS", help="start services of the system whose router is at that address")
    hosts.add_argument("--only", type=_names, default=(), metavar="SERVICE,..", help="with --join: the services to start here")
    text = "with --join: the name of this host in status and events (default: the computer's name)"
    hosts.add_argument("--host", metavar="NAME", help=text)
    parser.add_argument("--runs", type=Path, default=Path("runs"), metavar="DIR", help="parent of the run's folder (default: runs)")


def _names(text: str) -> tuple[str, ...]:
    names = tuple(name.strip() for name in text.split(","))
    if not all(names):
        raise argparse.ArgumentTypeError(f"{text!r}: write the names of services with commas between them, such as vision,monitor")
    return tuple(dict.fromkeys(names))


def _check(arguments: argparse.Namespace) -> None:
    """Raise UserError for options that do not go together."""
    for option, value in (("--only", arguments.only), ("--host", arguments.host)):
        if value and arguments.join is None:
            raise UserError(f"{option} is for a host that joins another one's system: give --join ADDRESS too", BAD_INPUT)
    if arguments.join is not None and not arguments.only:
        raise UserError("--join needs --only: the services to start on this host, such as --only vision,monitor", BAD_INPUT)
    for option, value in (("--endpoint", arguments.endpoint), ("--elsewhere", arguments.elsewhere), ("--insecure", arguments.insecure)):
        if value and arguments.join is not None:
            raise UserError(f"{option} is for the host with the router: leave it out with --join", BAD_INPUT)


def _computer() -> str:
    """Return the computer's name, as a name on the bus."""
    return re.sub(r"[^a-z0-9_]+", "_", socket.gethostname().partition(".")[0].lower()).strip("_") or "other"


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee launch`: start the scenario, wait for its end, and return the exit code of `services.launcher.run.launch`."""
    _check(arguments)
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
            elsewhere=arguments.elsewhere,
            join=arguments.join,
            only=arguments.only,
            host=arguments.host or _computer(),
        )
    )
