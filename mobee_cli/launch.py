"""`mobee launch`: start a scenario, keep it running, stop it, sum it up."""

from __future__ import annotations

import argparse
from pathlib import Path

from experiments.kit.command_line import positive_number, positive_whole
from services.launcher.run import Options, launch
from services.launcher.scenario import shipped

_NOTES = """Shipped scenarios: {scenarios}.
Ctrl-C once stops everything, twice kills.  The summary goes to standard output, all else to standard error."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Scenario and options."""
    parser.epilog = _NOTES.format(scenarios=", ".join(shipped()))
    parser.add_argument("scenario", nargs="?", default="default", help="shipped name, or path of a .toml file (default: default)")
    parser.add_argument(
        "--set",
        dest="settings",
        action="append",
        default=[],
        metavar="FIELD=VALUE",
        help="change a setting: services.model.contact_forces=false",
    )
    parser.add_argument("--headless", action="store_true", help="leave the monitor out")
    parser.add_argument("--duration", type=positive_number, metavar="S", help="seconds to run, from when all services are ready")
    parser.add_argument("--ticks", type=positive_whole, metavar="N", help="lockstep: end after so many ticks (shared.mode=lock)")
    parser.add_argument("--json", action="store_true", help="print the summary as JSON")
    parser.add_argument("--endpoint", metavar="ADDRESS", help="where the router listens (default: the scenario's, or tcp/127.0.0.1:7447)")
    parser.add_argument("--runs", type=Path, default=Path("runs"), metavar="DIR", help="where the run's folder is made (default: runs)")


def run(arguments: argparse.Namespace) -> int:
    """Launch, and stay until the end."""
    return launch(
        Options(
            scenario=arguments.scenario,
            settings=tuple(arguments.settings),
            headless=arguments.headless,
            duration=arguments.duration,
            ticks=arguments.ticks,
            json=arguments.json,
            endpoint=arguments.endpoint,
            runs=arguments.runs,
        )
    )
