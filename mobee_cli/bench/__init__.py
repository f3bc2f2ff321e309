"""`mobee bench`: measure mobee on this machine, beside its peers."""

from __future__ import annotations

import argparse
import importlib

from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT

# One module of this package a benchmark: `add_arguments(parser)`, and `run(arguments)`, which returns the exit code.
BENCHES = {
    "lockstep": "the live processes in lockstep, in multiples of real time",
    "agree": "the live processes in lockstep against the offline plant: one law",
    "start": "import, first pose, and the whole system: time and memory",
    "live": "the live processes in real time: how late commands are",
    "plant": "the offline plant beside MuJoCo's stepper",
    "vi": "planning: value iteration beside SciPy and quantecon",
    "nes": "evolution strategies beside CMA-ES",
    "ik": "inverse kinematics beside mink, CMA-ES and others",
    "trm": "a map of 5000 poses by least squares and by evolution",
    "edges": "checking the edges of a map of 5000 poses",
    "model": "the egocentric model beside MuJoCo and python-fcl",
    "against": "another checkout beside this one, in processor time",
}
_NOTES = """Exit code: 0 every requirement is met and all agree, 1 not, 3 a peer is not installed or a system did not start."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One parser a benchmark."""
    benches = parser.add_subparsers(dest="bench", required=True, metavar="|".join(BENCHES))
    for name, text in BENCHES.items():
        module = importlib.import_module(f"mobee_cli.bench.{name}")
        one = benches.add_parser(name, help=text, description=module.__doc__, epilog=_NOTES)
        one.add_argument("--json", action="store_true", help="print as JSON")
        module.add_arguments(one)


def run(arguments: argparse.Namespace) -> int:
    """Measure and print."""
    from experiments.bench.against import AgainstFailed
    from experiments.bench.cma_peer import CmaMissing
    from experiments.bench.mink_peer import MinkMissing
    from experiments.bench.mujoco_peer import MujocoMissing
    from experiments.bench.vi_peers import QuanteconMissing
    from experiments.kit.live.launch import LaunchFailed
    from mobee.errors import NotInstalled

    try:
        code: int = importlib.import_module(f"mobee_cli.bench.{arguments.bench}").run(arguments)
    except (AgainstFailed, CmaMissing, MinkMissing, MujocoMissing, QuanteconMissing, LaunchFailed, NotInstalled) as error:
        raise UserError(str(error), ENVIRONMENT) from None
    return code
