# SPDX-License-Identifier: Apache-2.0
"""`mobee bench`: measures the speed of mobee on this machine, and compares it with other programs."""

from __future__ import annotations

import argparse
import importlib
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any

from experiments.bench.against_cases import CASES
from experiments.kit.command_line import positive_number, positive_whole, whole
from experiments.kit.live.floods import FLOODS
from mobee_cli.errors import UserError
from services.common.exit_codes import ENVIRONMENT, FAILED, OK

_MAX_RATE = 1000  # Hz, of robot_sim
_PICTURES = (".png", ".svg", ".pdf")
_NOTES = "Exit code: 0 every requirement is met and all agree, 1 not, 3 another program is not installed or a system did not start."


@dataclass(frozen=True, slots=True)
class Bench:
    """The options of one benchmark. The benchmark itself is the module `experiments.bench.<name>`.

    The module has a class `Settings`, whose fields have the names of the options, a function `measure(settings)`, which returns JSON data
    with the verdict under "passed", and a function `report(result)`, which returns the result as text. With --quick it also has `QUICK`,
    the settings for a short measurement.

    `text`: description. `quick`, `figure`: help texts of --quick and --figure; None: no such option. `options`: arguments of argparse's
    add_argument, by option.
    """

    text: str
    quick: str | None = None
    figure: str | None = None  # help of --figure; drawn by experiments.bench.cost_figures
    options: Mapping[str, Mapping[str, Any]] | None = None


def _rate(text: str) -> int:
    rate = positive_whole(text)
    if rate > _MAX_RATE:
        raise argparse.ArgumentTypeError(f"{text} Hz: robot_sim makes at most {_MAX_RATE}")
    return rate


def _count_of_boxes(text: str) -> int:
    if not (text.isascii() and text.isdecimal() and int(text) <= 1000):
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number from 0 to 1000")
    return int(text)


def _picture(text: str) -> Path:
    path = Path(text)
    if path.suffix not in _PICTURES:
        raise argparse.ArgumentTypeError(f"{text!r} is not a picture; valid endings: {', '.join(_PICTURES)}")
    if not path.absolute().parent.is_dir():
        raise argparse.ArgumentTypeError(f"{text!r}: there is no folder {str(path.parent)!r}; make it first")
    return path


def _number(help: str, type: Callable[[str], Any] = positive_whole, metavar: str = "N") -> dict[str, Any]:
    return {"type": type, "metavar": metavar, "help": help}


BENCHES = {
    "lockstep": Bench(
        "the live system in lockstep, in multiples of real time, on the motor model alone, on PyBullet and on MuJoCo",
        options={"--seconds": _number("how long each of the six runs lasts (default: 20)", positive_number, "S")},
    ),
    "agree": Bench(
        "the live system in lockstep beside the offline plant: the same agents, action by action, encoder noise included",
        options={
            "--actions": _number("how many to compare, about (default: 100)"),
            "--seed": _number("of agents and noise (default: 0)", whole),
        },
    ),
    "start": Bench(
        "import, first pose, and start of the whole system: time and memory",
        quick="5 processes of each, one start of the system (default: 15 and 3)",
    ),
    "play": Bench(
        "`mobee play` in a home without files: from the command to the first curious action that a browser shows",
        quick="one start of each robot (default: 3)",
        options={
            "--robots": {"nargs": "+", "metavar": "ROBOT", "help": "names or files of robots (default: icub)"},
            "--python": {"metavar": "PYTHON", "help": "interpreter whose MoBeE is measured (default: this one)"},
        },
    ),
    "live": Bench(
        "the live system in real time: jitter of the controller's period and age of the command in force, at several rates",
        options={
            "--rates": {"type": _rate, "nargs": "+", "metavar": "HZ", "help": "ticks a second (default: 100 200 500 1000)"},
            "--seconds": _number("how long each run lasts (default: 30)", positive_number, "S"),
            "--backend": {"choices": ("kinematic", "pybullet", "mujoco"), "help": "the robot (default: kinematic)"},
        },
    ),
    "stop": Bench(
        "the emergency stop under floods of messages, calls, tokens and connections: time until robot_sim obeys",
        quick="four floods, 5 stops under each",
        options={
            "--floods": {"nargs": "+", "choices": ("nothing", *FLOODS), "metavar": "FLOOD", "help": "names of floods (default: all)"},
            "--stops": _number("stops under each flood (default: 20)"),
        },
    ),
    "faults": Bench(
        "a live system under schedules of faults: time to hold, recovery, and whether transitions are lost",
        quick="two schedules",
        options={
            "--schedules": _number("how many (default: 20)"),
            "--seed": _number("number of the first schedule (default: 1)", whole),
            "--seconds": _number("how long each lasts (default: 10)", positive_number, "S"),
            "--period": _number("mean time between two faults (default: 4)", positive_number, "S"),
            "--shrink": _number("performances to shrink a schedule that breaks a promise (default: none)"),
            "--scenario": {"metavar": "NAME", "help": "launched without monitor (default: kinematic)"},
            "--quiet": _number("first without faults, whose transitions are compared (default: 0)", positive_number, "S"),
        },
    ),
    "network": Bench(
        "a system on two hosts while packets are delayed, lost and reordered and the network is cut: what is obeyed, hold, recovery",
        quick="three faults instead of seven",
        options={
            "--layouts": {"nargs": "+", "choices": ("agent", "control"), "help": "what is beyond the network (default: both in turn)"},
            "--seconds": _number("how long each fault lasts (default: 4)", positive_number, "S"),
            "--rounds": _number("how often each fault (default: 1)"),
            "--seed": _number("of delayed, lost and reordered packets (default: 1)", whole),
        },
    ),
    "fuzz": Bench(
        "nearly valid messages, calls and tokens to a live system: processes that end, memory that grows",
        quick="40 000 messages",
        options={
            "--messages": _number("messages, calls and tokens together (default: 1 000 000)"),
            "--seed": _number("of what is drawn (default: 1)", whole),
        },
    ),
    "soak": Bench(
        "a system that runs for hours: memory, open files and threads of its processes, and whether it becomes slower",
        quick="12 minutes of the robot",
        options={
            "--hours": _number("of the robot (default: 8)", positive_number, "H"),
            "--scenario": {"metavar": "NAME", "help": "without monitor (default: lockstep)"},
        },
    ),
    "plant": Bench(
        "the offline plant compared with MuJoCo's stepper: one arm, reaching, three agents at the table, and the same hash twice",
        quick="one short round",
        figure="tick and objects",
    ),
    "vi": Bench(
        "plans beside exact policy iteration, SciPy's sparse matrices and quantecon: how exact, how fast",
        quick="50 random problems, 3 rounds; figure: up to 10 000 states",
        figure="states and discount",
    ),
    "nes": Bench(
        "evolution strategies beside CMA-ES: evaluations on rotated functions, from the same starts",
        quick="10 dimensions alone, 3 runs of each",
        options={"--runs": _number("runs of each function (default: 11)")},
    ),
    "ik": Bench(
        "inverse kinematics of a palm among boxes beside mink, CMA-ES and others: how often, how fast",
        quick="20 targets, 5 for all motors and for the rivals (default: 300, 60, 40)",
    ),
    "trm": Bench(
        "the pre-grasp map of thesis figure 4.8 by least squares and by evolution: how fast, how complete, how valid",
        quick="30 mm instead of 8 between poses",
        options={"--seeds": _number("maps of each method, of which the worst counts (default: 1)")},
    ),
    "gym": Bench(
        "the Gymnasium environments compared with MuJoCo's: steps per second, alone and in a batch",
        quick="two short rounds",
    ),
    "edges": Bench(
        "checks of all edges of a map, and of those near a change of the world",
        quick="a map of 500 vertices, one round (default: 5000, 5 rounds)",
    ),
    "model": Bench(
        "the egocentric model compared with MuJoCo and python-fcl: poses per second, and the same contacts",
        quick="5 rounds of 500 poses, 50 poses to compare",
        figure="objects and primitives",
        options={
            "--objects": {
                "type": _count_of_boxes,
                "nargs": "+",
                "dest": "boxes",
                "metavar": "N",
                "help": "boxes, 0 to 1000 each (default: 0 10 100 1000)",
            },
            "--rounds": _number("turns of everything that is timed (default: 15)"),
        },
    ),
    "against": Bench(
        "another checkout beside this one: processor time of plant, agents, plans, maps and lockstep",
        options={
            "old": {"metavar": "OLD", "help": "the other checkout: a folder, or a commit of this repository"},
            "--new": {"metavar": "NEW", "help": "instead of this checkout"},
            "--old-python": {"metavar": "PYTHON", "help": "that runs it, with its libraries (default: this one)"},
            "--cases": {
                "nargs": "+",
                "choices": tuple(CASES),
                "metavar": "CASE",
                "help": f"of {', '.join(map(repr, CASES))} (default: all)",
            },
            "--rounds": _number("runs of each case in each checkout (default: 5)"),
        },
    ),
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee bench` to the parser: one subcommand for each benchmark."""
    benches = parser.add_subparsers(dest="bench", required=True, metavar="BENCHMARK")
    for name, bench in BENCHES.items():
        one = benches.add_parser(name, help=bench.text, description=bench.text, epilog=_NOTES)
        one.add_argument("--json", action="store_true", help="print as JSON")
        for option, details in (bench.options or {}).items():
            one.add_argument(option, **details)
        if bench.quick is not None:
            one.add_argument("--quick", action="store_true", help=bench.quick)
        if bench.figure is not None:
            one.add_argument("--figure", type=_picture, metavar="FILE", help=f"draw cost against {bench.figure} instead (.png, .svg, .pdf)")


def run(arguments: argparse.Namespace) -> int:
    """Run `mobee bench`: measure, print the result or draw the figure, and return the exit code."""
    from experiments.bench.against import AgainstFailed
    from experiments.kit.live.launch import LaunchFailed
    from experiments.kit.plots import MatplotlibMissing

    try:
        return _draw(arguments) if getattr(arguments, "figure", None) else _measure(arguments)
    except (AgainstFailed, LaunchFailed, MatplotlibMissing) as error:
        raise UserError(str(error), ENVIRONMENT) from None


def _measure(arguments: argparse.Namespace) -> int:
    module = importlib.import_module(f"experiments.bench.{arguments.bench}")
    given = {field.name: getattr(arguments, field.name, None) for field in fields(module.Settings)}
    given = {name: value for name, value in given.items() if value is not None}
    settings = replace(module.QUICK, **given) if getattr(arguments, "quick", False) else module.Settings(**given)
    result = module.measure(settings)
    print(json.dumps(result, indent=2) if arguments.json else module.report(result))
    return OK if result["passed"] else FAILED


def _draw(arguments: argparse.Namespace) -> int:
    from experiments.bench.cost_figures import FIGURES

    curves = FIGURES[arguments.bench].write(arguments.figure, arguments.quick, getattr(arguments, "rounds", None))
    print(json.dumps(curves, indent=2) if arguments.json else arguments.figure)
    return OK
