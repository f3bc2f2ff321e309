"""The live processes in real time: jitter of the controller's period and age of the command in force, at several rates."""

from __future__ import annotations

import argparse
import json

from experiments.kit.command_line import positive_number, positive_whole
from services.common.exit_codes import FAILED

_HIGHEST = 1000  # Hz, of robot_sim


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What may be chosen."""
    parser.add_argument(
        "--rates", type=_rate, nargs="+", default=[100, 200, 500, 1000], metavar="HZ", help="ticks a second (default: 100 200 500 1000)"
    )
    parser.add_argument("--seconds", type=positive_number, default=30.0, metavar="S", help="how long each run lasts (default: 30)")
    parser.add_argument("--backend", choices=("kinematic", "pybullet"), default="kinematic", help="the robot (default: kinematic)")


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.live import measure, report

    result = measure(tuple(arguments.rates), arguments.seconds, arguments.backend)
    print(json.dumps(result, indent=2) if arguments.json else report(result))
    return 0 if result["passed"] else FAILED


def _rate(text: str) -> int:
    rate = positive_whole(text)
    if rate > _HIGHEST:
        raise argparse.ArgumentTypeError(f"{text} Hz: robot_sim makes at most {_HIGHEST}")
    return rate
