"""The live processes in lockstep against the offline plant: the same agents, action by action, encoder noise included."""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import asdict
from pathlib import Path

from experiments.kit.command_line import positive_whole
from services.common.exit_codes import FAILED


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument("--actions", type=positive_whole, default=100, metavar="N", help="how many to compare, about (default: 100)")
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of agents and noise (default: 0)")


def run(arguments: argparse.Namespace) -> int:
    """Run both and compare."""
    from experiments.bench.agree import measure

    with tempfile.TemporaryDirectory() as folder:
        agreement, summary = measure(arguments.actions, arguments.seed, Path(folder))
    if arguments.json:
        print(json.dumps({**asdict(agreement), "passed": agreement.passed, "lockstep": summary["lockstep"]}, indent=2))
    else:
        print(f"{agreement.actions} actions: they end within {agreement.worst:.1e} rad of each other in lockstep and offline")
        print(agreement.first_difference or "in the same ticks and states, settled or not, touching the same")
    return 0 if agreement.passed else FAILED
