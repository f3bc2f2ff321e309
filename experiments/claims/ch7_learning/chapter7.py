# SPDX-License-Identifier: Apache-2.0
"""Run all experiments of chapter 7 one after the other, with their figures.

Claim: the thesis' experiments in model learning can be repeated, with all figures, by one command.  Source: thesis chapter 7, paper section
3.  Published number: the robot took over two days for the longest of them (7.4).
Run time: 23 minutes on 2 cores.  --all adds the experiments that thesis and paper only propose, and our own studies: 45 minutes.

Every experiment has its own folder in the folder of the run, as if it had been run alone.  An interrupted experiment continues; one that
fails writes failed.txt and does not stop the others.  With --resume and more --seeds, finished experiments continue too.  Afterwards,
`mobee experiment claims` reads the results.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from pathlib import Path
from typing import Any

from experiments.kit.command_line import positive_whole
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.plots import MatplotlibMissing
from experiments.kit.run_folder import CONFIG, RESULTS, read, write
from experiments.kit.sweep import ENGINES
from experiments.registry import BEYOND, CHAPTER7, all_names, current_name, load_experiment
from mobee.errors import MobeeError, UnknownName

_COMMON = ("seeds", "jobs", "engine", "quick")  # options that are handed on
_TIMES, _FAILURE = "seconds.json", "failed.txt"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add --only (names of experiments) and --all (also those beyond the chapter), and the options that all experiments get.

    These are --seeds, --jobs, --engine and --quick.
    """
    parser.add_argument("--only", nargs="+", metavar="NAME", help=f"of {', '.join((*CHAPTER7, *BEYOND))}")
    parser.add_argument("--all", action="store_true", help=f"also {', '.join(BEYOND)}")
    parser.add_argument("--seeds", type=positive_whole, metavar="N", help="repetitions (default: each experiment's own)")
    parser.add_argument("--jobs", type=positive_whole, metavar="N", help="how many run at once (default: one a core)")
    parser.add_argument("--engine", choices=ENGINES, help="processes of this machine, or a Ray cluster (default: processes)")
    parser.add_argument("--quick", action="store_true", help="short versions that show whether all works")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run the chosen experiments of chapter 7 that are not finished, and draw their figures.

    Returns "parts", for each experiment its run time "minutes", its "figure" and, if it failed, the reason "failed"; the total "minutes";
    and "passed", False if an experiment failed.  Raises UnknownName for a name after --only that is no experiment of the chapter.
    """
    every = (*CHAPTER7, *BEYOND)
    names = [current_name(name) for name in arguments.only or (every if arguments.all else CHAPTER7)]
    for name in names:
        if name not in every:
            raise UnknownName("experiment of chapter 7", name, every)
    parts: dict[str, Any] = {}
    for number, name in enumerate(names, 1):
        if sys.stderr.isatty():
            print(f"{name} ({number} of {len(names)})", file=sys.stderr)
        parts[name] = _part(name, arguments, folder)
    seconds = sum(part["minutes"] for part in parts.values())
    passed = not any("failed" in part for part in parts.values())
    return {"parts": {name: {"minutes": 0.0, "figure": "-", **part} for name, part in parts.items()}, "minutes": seconds, "passed": passed}


def figure(folder: Path) -> Path:
    """Draw the figures of all finished experiments again, and return `folder`, which has a folder for each experiment."""
    for results in sorted(folder.glob(f"*/{RESULTS}")):
        load_experiment(read(results.parent / CONFIG)["experiment"]).method.figure(results.parent)
    return folder


def _part(name: str, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Run one experiment in its own folder; returns its run time, and its figure or the reason why it failed."""
    begun = [folder / one for one in all_names(name) if (folder / one).exists()]  # an older run has it under its former name
    place, start = begun[0] if begun else folder / name, time.monotonic()
    place.mkdir(exist_ok=True)
    try:
        options = options_of_part(name, arguments)
        if not _is_finished(place, options):
            (place / RESULTS).unlink(missing_ok=True)  # of fewer seeds
            own = dict(vars(options))
            write(place / CONFIG, {"experiment": name, "options": own})
            vars(options).update(runs=folder, resume=place, json=False)  # as the command has them
            experiment = load_experiment(name)
            write(place / RESULTS, experiment.decided(experiment.method.run(options, place), own))
        drawn = _drawn(name, place)
        (place / _FAILURE).unlink(missing_ok=True)
    except Exception as error:  # of the experiment's own code: it is reported, and the others continue
        (place / _FAILURE).write_text(traceback.format_exc())
        reason = str(error) if isinstance(error, MobeeError) else f"{type(error).__name__}: {error}"
        return {"minutes": _spent(place, start), "failed": reason}
    finally:
        spent = _spent(place, start)
        write(place / _TIMES, {"seconds": 60.0 * spent})
    return {"minutes": spent, "figure": drawn}


def _is_finished(place: Path, options: argparse.Namespace) -> bool:
    """Return whether there are results of at least as many seeds as the options ask for."""
    return (place / RESULTS).exists() and getattr(options, "seeds", 0) <= read(place / CONFIG)["options"].get("seeds", 0)


def _drawn(name: str, place: Path) -> str:
    try:
        return str(load_experiment(name).method.figure(place).relative_to(place.parent))
    except MatplotlibMissing:
        return "-"


def _spent(place: Path, start: float) -> float:
    """Return the run time of an experiment until now in minutes, including its earlier calls, such as interrupted ones.

    `place`: folder of the experiment, in which the time of earlier calls is saved.  `start`: `time.monotonic()` [s] when this call began.
    """
    before = read(place / _TIMES)["seconds"] if (place / _TIMES).exists() else 0.0
    return float(before + time.monotonic() - start) / 60.0


def options_of_part(name: str, arguments: argparse.Namespace) -> argparse.Namespace:
    """Return the options for one experiment: its defaults, its seed, and the common options that were given for all.

    The common options are --seeds, --jobs, --engine and --quick.
    """
    parser = argparse.ArgumentParser()
    load_experiment(name).method.add_arguments(parser)
    options = parser.parse_args([])
    options.seed = arguments.seed
    for common in _COMMON:
        if getattr(arguments, common) and hasattr(options, common):
            setattr(options, common, getattr(arguments, common))
    return options


EXPERIMENT = Experiment(
    claim="all experiments in model learning can be repeated by one command",
    source="thesis chapter 7, paper section 3",
    method=Steps(add_arguments, run, figure),
)
