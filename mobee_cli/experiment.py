# SPDX-License-Identifier: Apache-2.0
"""`mobee experiment`: lists and runs experiments, draws figures, prints claims.

A claim is a statement of a publication, or an aim of this project, with the number that an experiment has measured for it.
"""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
import time
from collections.abc import Sequence
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from experiments.claims_table import (
    all_differences,
    better,
    claims_text,
    entries_of,
    finished_runs,
    keep_records,
    recorded,
    replaced,
    require_seeds,
    rows,
    runs_in,
    with_confirmed,
    write_page,
)
from experiments.frozen_rules import CONFIRMING_SEED, FROZEN, freeze
from experiments.kit.command_line import whole
from experiments.kit.experiment import Claim, Experiment
from experiments.kit.plots import MatplotlibMissing
from experiments.kit.raw_records import opened_record
from experiments.kit.run_folder import (
    RESULTS,
    discard_unused,
    experiment_of,
    given_run,
    keep_options,
    locked,
    new_run,
    newest_run,
    options_of,
    write,
)
from experiments.kit.sweep import CellsFailed
from experiments.kit.track import FOLDER as TRACK
from experiments.kit.track import add_track, require_tracker, track_stores, tracked
from experiments.registry import EXPERIMENTS, current_name, load_experiment
from mobee.errors import InvalidValue, MobeeError, NotInstalled
from mobee_cli.errors import UserError
from mobee_cli.results_text import results_text
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, INTERRUPTED

RUNS = Path("runs")
_NEWEST = Path()  # --resume without the name of a run
_NOT_OPTIONS = ("json", "runs", "resume", "track")  # of the experiment: they may differ when it is resumed


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the options of `mobee experiment` to the parser: one subcommand for each action (list, run, figure, claims)."""
    parser.set_defaults(make_parser=type(parser))
    actions = parser.add_subparsers(dest="action", required=True, metavar="list|run|figure|claims")
    listing = actions.add_parser("list", help="list all experiments", description="List all experiments with claims and sources.")
    listing.add_argument("--json", action="store_true", help="print as JSON")
    text = "Run an experiment; `mobee experiment run NAME --help` explains its options."
    running = actions.add_parser("run", help="run an experiment", description=text)
    running.add_argument("name", metavar="NAME", help=", ".join(EXPERIMENTS))
    options = running.add_argument("options", nargs=argparse.REMAINDER, metavar="options", help="options of the experiment")
    options.required = False  # argparse would name them as missing beside NAME
    drawing = actions.add_parser("figure", help="draw the figure of a run", description="Draw the figure of a run.")
    drawing.add_argument("name", metavar="NAME|RUN", help="folder of a run, or the name of an experiment, for its newest run")
    drawing.add_argument("folder", nargs="?", type=Path, metavar="RUN", help="folder of the run, after the name of an experiment")
    drawing.add_argument("--record", action="store_true", help="draw the raw record of the repository, into NAME.png here")
    drawing.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="parent of the runs' folders (default: runs)")
    drawing.add_argument("--json", action="store_true", help="print as JSON")
    text = "Print the table of claims: published and measured numbers. Without RUN and --write it is the table of experiments/README.md."
    claiming = actions.add_parser("claims", help="print the table of claims", description=text)
    claiming.add_argument("folders", nargs="*", type=Path, metavar="RUN", help="folders of finished runs, to use their numbers")
    doing = claiming.add_mutually_exclusive_group()
    doing.add_argument("--write", action="store_true", help="write experiments/README.md; without RUN from the runs with the most seeds")
    text = "with --write: from runs with new seeds, which confirm those of the table; once for each experiment"
    claiming.add_argument("--confirm", action="store_true", help=text)
    text = "write the rules of experiments, by name, or of all, into experiments/frozen.json, before they are run with new seeds"
    doing.add_argument("--freeze", nargs="*", metavar="NAME", help=text)
    text = "compute all verdicts and intervals from the raw records of the repository, and compare them with the table"
    doing.add_argument("--check", action="store_true", help=text)
    claiming.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="parent of these runs' folders (default: runs)")
    claiming.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Run the action of `mobee experiment` that the arguments name, and return the exit code."""
    try:
        if arguments.action == "list":
            return _list(arguments)
        if arguments.action == "claims":
            return _claims(arguments)
        if arguments.action == "figure":
            return _figure(arguments)
        experiment = load_experiment(arguments.name)
        return _run(experiment, _options(experiment, arguments.make_parser, arguments.options))
    except (MatplotlibMissing, NotInstalled) as error:
        raise UserError(str(error), ENVIRONMENT) from None
    except MobeeError as error:
        raise UserError(str(error), BAD_INPUT) from None


def _list(arguments: argparse.Namespace) -> int:
    found = [load_experiment(name) for name in EXPERIMENTS]
    if arguments.json:
        print(json.dumps([{"name": e.name, "claim": e.claim, "source": e.source} for e in found], indent=2))
        return 0
    columns = shutil.get_terminal_size().columns  # 80 in a pipe
    indent = max(len(experiment.name) for experiment in found) + 1
    for experiment in found:
        text = f"{experiment.claim} ({experiment.source})"
        head = f"{experiment.name:<{indent}}"
        print(textwrap.fill(text, columns, initial_indent=head, subsequent_indent=" " * indent, break_on_hyphens=False))
    return 0


def _options(experiment: Experiment, make_parser: type[argparse.ArgumentParser], given: Sequence[str]) -> argparse.Namespace:
    """Parse the options of a run; a resumed run keeps its own unless they are given again."""
    notes = _wrapped(experiment.notes.strip())
    parser = make_parser(
        prog=f"mobee experiment run {experiment.name}", description=notes, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    experiment.method.add_arguments(parser)
    parser.add_argument("--seed", type=whole, default=0, metavar="N", help="seed of the random numbers (default: 0)")
    parser.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="parent of the run's folder (default: runs)")
    parser.add_argument("--resume", nargs="?", const=_NEWEST, type=Path, metavar="RUN", help="resume a run, or the newest one")
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    add_track(parser)
    options = parser.parse_args(given)
    require_tracker(options.track)
    if options.resume is None:
        return options
    run = newest_run(options.runs, experiment.name) if options.resume == _NEWEST else options.resume
    begun = options_of(run, experiment.name)
    parser.set_defaults(**begun)
    options = parser.parse_args(given)
    options.resume, seed = run, begun.get("seed")
    if options.seed != seed:
        raise InvalidValue(f"{run} has seed {seed}, not {options.seed}. Start a new run without --resume.")
    made, asked = (given.get(experiment.repeats) for given in (begun, vars(options)))
    if made is not None and asked is not None and asked < made:
        raise InvalidValue(
            f"{run} was started with {made} {experiment.repeats}, not {asked}: those that are finished would count too. Give {made} or "
            "more, or start a new run without --resume."
        )
    if getattr(options, "quick", False) and not begun.get("quick"):
        raise InvalidValue(f"{run} was started without --quick; their results must not be mixed. Start a new run without --resume.")
    return options


def _wrapped(notes: str) -> str:
    """Wrap paragraphs to the width of the terminal."""
    columns = shutil.get_terminal_size().columns
    return "\n\n".join(textwrap.fill(" ".join(text.split()), columns, break_on_hyphens=False) for text in notes.split("\n\n"))


def _run(experiment: Experiment, options: argparse.Namespace) -> int:
    folder: Path | None = options.resume
    try:
        own = {key: value for key, value in vars(options).items() if key not in _NOT_OPTIONS}
        folder = folder or new_run(options.runs, experiment.name, own)
        with locked(folder):
            if options.resume:
                keep_options(folder, experiment.name, own)
            results = _results(experiment, options, folder)
            write(folder / RESULTS, results)
            if options.track:
                track_stores(folder)
    except OSError as error:
        if folder is None:
            raise UserError(f"cannot write the run's folder: {error}; name another with --runs", ENVIRONMENT) from None
        resume = f"`mobee experiment run {experiment.name} --resume {folder}`"
        raise UserError(f"cannot read or write a file: {error}; what is finished is kept; continue with {resume}", ENVIRONMENT) from None
    except CellsFailed as error:
        raise UserError(f"{error}\nRepeat them with `mobee experiment run {experiment.name} --resume {folder}`", FAILED) from None
    except KeyboardInterrupt:
        if folder is None:  # there is nothing to resume yet
            raise
        raise UserError(f"interrupted; resume with `mobee experiment run {experiment.name} --resume {folder}`", INTERRUPTED) from None
    if options.json:
        print(json.dumps({"run": str(folder), **results}, indent=2))
    else:
        print(f"run: {folder}")
        if options.track:
            print(f"curves: tensorboard --logdir {folder / TRACK}")
        claims = [(experiment.name, Claim(**claim)) for claim in results.pop("claims", [])]
        print(results_text(results, shutil.get_terminal_size().columns))  # 80 in a pipe
        if claims:
            print(claims_text(claims, shutil.get_terminal_size().columns))
    return FAILED if results.get("passed") is False else 0


def _results(experiment: Experiment, options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    try:
        with tracked(folder / TRACK) if options.track else nullcontext():
            return experiment.decided(experiment.method.run(options, folder), vars(options))
    except MobeeError:
        if options.resume is None:
            discard_unused(folder)
        raise


def _claims(arguments: argparse.Namespace) -> int:
    if arguments.confirm and not arguments.write:
        raise InvalidValue("--confirm needs --write: it writes the numbers of new seeds into the table.")
    if arguments.check:
        return _check(arguments)
    if arguments.freeze is not None:
        return _freeze(arguments)
    chosen = _runs_to_write(arguments) if arguments.write else arguments.folders
    found = runs_in(chosen)
    merge = with_confirmed if arguments.confirm else better if arguments.write and not arguments.folders else replaced
    record = merge(recorded(), entries_of(found))
    failed = keep_records(found, record, arguments.confirm) if arguments.write else []
    if arguments.write:
        write_page(record)
    table = rows(record)
    if arguments.json:
        print(json.dumps([{"experiment": name, **claim.record()} for name, claim in table], indent=2))
    else:
        print(claims_text(table, shutil.get_terminal_size().columns))
    if failed:
        raise UserError("\n".join([*failed, "The claims of these experiments are open; all others are written."]), FAILED)
    return 0


def _runs_to_write(arguments: argparse.Namespace) -> list[Path]:
    """Return the runs that the table is written from; raises InvalidValue for --confirm without a run that has new seeds."""
    if arguments.folders:
        require_seeds(arguments.folders, arguments.confirm)
        return list(arguments.folders)
    found = finished_runs(arguments.runs, arguments.confirm)
    if arguments.confirm and not found:
        started = f"`mobee experiment run NAME --seed {CONFIRMING_SEED} --seeds 30`"
        raise InvalidValue(f"{arguments.runs} has no finished run with new seeds: start one with {started}, or name its folder.")
    return found


def _freeze(arguments: argparse.Namespace) -> int:
    """Freeze (write to the file FROZEN) the rules by which the named experiments, or all, are judged.

    The rules are frozen before the experiments run with new seeds.
    """
    if arguments.folders:
        raise InvalidValue("--freeze takes names of experiments, and no RUN: rules are frozen before the experiment is run with new seeds.")
    names = freeze([load_experiment(name).name for name in arguments.freeze or EXPERIMENTS])
    if arguments.json:
        print(json.dumps({"file": str(FROZEN), "frozen": names}, indent=2))
    else:
        print(f"{FROZEN}: the rules of {', '.join(names) or 'no experiment, because the named ones have no claims'}")
    return 0


def _check(arguments: argparse.Namespace) -> int:
    """Compare the table of claims (claims.json) with the raw records; the exit code is FAILED if a number or a verdict differs."""
    if arguments.folders:
        raise InvalidValue("--check takes no RUN: it compares the raw records of the repository with the table.")
    start, record = time.monotonic(), recorded()
    lines = all_differences(record)
    if arguments.json:
        print(json.dumps({"experiments": len(record), "differences": lines, "seconds": round(time.monotonic() - start, 1)}, indent=2))
    else:
        print("\n".join(lines + [f"{len(record)} experiments computed in {time.monotonic() - start:.0f} s: {len(lines)} differences"]))
    return FAILED if lines else 0


def _figure(arguments: argparse.Namespace) -> int:
    runs, name, folder = arguments.runs, arguments.name, arguments.folder
    if arguments.record:
        return _figure_of_record(arguments)
    if folder is None and current_name(name) not in EXPERIMENTS and Path(name).is_dir():
        name, folder = experiment_of(Path(name)), Path(name)
    experiment = load_experiment(name)
    run = given_run(folder, runs, name) if folder else newest_run(runs, name)
    options_of(run, name)  # raises InvalidValue for a run of another experiment
    path = experiment.method.figure(run)
    print(json.dumps({"figure": str(path)}) if arguments.json else path)
    return 0


def _figure_of_record(arguments: argparse.Namespace) -> int:
    if arguments.folder is not None:
        raise InvalidValue("--record takes the name of an experiment alone, and no RUN.")
    experiment = load_experiment(arguments.name)
    with opened_record(experiment.name) as run:
        drawn = experiment.method.figure(run)
        path = Path(shutil.copy(drawn, f"{experiment.name}{drawn.suffix}"))
    print(json.dumps({"figure": str(path)}) if arguments.json else path)
    return 0
