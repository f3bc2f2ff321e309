"""`mobee experiment`: the experiments that come with mobee."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.claims_table import better, claims_text, finished_runs, found_in, recorded, rows, write_page
from experiments.kit.experiment import Claim, Experiment, open_with_few_seeds
from experiments.kit.plots import MatplotlibMissing
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
from experiments.registry import EXPERIMENTS, current_name, load_experiment
from mobee.errors import InvalidValue, MobeeError, NotInstalled
from mobee_cli.errors import UserError
from mobee_cli.results_text import results_text
from services.common.exit_codes import BAD_INPUT, ENVIRONMENT, FAILED, INTERRUPTED

RUNS = Path("runs")
_NEWEST = Path()  # --resume without the name of a run
_NOT_OPTIONS = ("json", "runs", "resume")  # of the experiment: they may differ when it goes on


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """One parser an action."""
    parser.set_defaults(make_parser=type(parser))
    actions = parser.add_subparsers(dest="action", required=True, metavar="list|run|figure|claims")
    listing = actions.add_parser("list", help="what there is", description="What there is: names, claims and their sources.")
    listing.add_argument("--json", action="store_true", help="print as JSON")
    text = "Run an experiment; `mobee experiment run NAME --help` tells its options."
    running = actions.add_parser("run", help="run one", description=text)
    running.add_argument("name", metavar="NAME", help=", ".join(EXPERIMENTS))
    running.add_argument("options", nargs=argparse.REMAINDER, metavar="options", help="of the experiment")
    drawing = actions.add_parser("figure", help="draw a run", description="Draw the figure of a run.")
    drawing.add_argument("name", metavar="NAME|RUN", help=f"folder of a run, or of whose newest: {', '.join(EXPERIMENTS)}")
    drawing.add_argument("folder", nargs="?", type=Path, metavar="RUN", help="folder of the run, after a name")
    drawing.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="where the newest is looked for (default: runs)")
    drawing.add_argument("--json", action="store_true", help="print as JSON")
    text = "The table of claims: what was published, what was found here. Without RUN and --write: as experiments/README.md has it."
    telling = actions.add_parser("claims", help="what holds", description=text)
    telling.add_argument("folders", nargs="*", type=Path, metavar="RUN", help="folders of finished runs, whose numbers are put in")
    telling.add_argument("--write", action="store_true", help="write experiments/README.md; without RUN from those with the most seeds")
    telling.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="where those are looked for (default: runs)")
    telling.add_argument("--json", action="store_true", help="print as JSON")


def run(arguments: argparse.Namespace) -> int:
    """Do the action."""
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
    """Options of the run; those of a run that is resumed are its own unless they are given again."""
    notes = _wrapped(experiment.notes.strip())
    parser = make_parser(
        prog=f"mobee experiment run {experiment.name}", description=notes, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    experiment.method.add_arguments(parser)
    parser.add_argument("--seed", type=int, default=0, metavar="N", help="of all that is random (default: 0)")
    parser.add_argument("--runs", type=Path, default=RUNS, metavar="DIR", help="where the run's folder is made (default: runs)")
    parser.add_argument("--resume", nargs="?", const=_NEWEST, type=Path, metavar="RUN", help="go on with a run, or with the newest")
    parser.add_argument("--json", action="store_true", help="print the results as JSON")
    options = parser.parse_args(given)
    if options.resume is None:
        return options
    run = newest_run(options.runs, experiment.name) if options.resume == _NEWEST else options.resume
    begun = options_of(run, experiment.name)
    parser.set_defaults(**begun)
    options = parser.parse_args(given)
    options.resume, seed = run, begun.get("seed")
    if options.seed != seed:
        raise InvalidValue(f"{run} has seed {seed}, not {options.seed}, and keeps it. Begin a new run without --resume.")
    if getattr(options, "quick", False) and not begun.get("quick"):
        raise InvalidValue(f"{run} was begun without --quick; what both find must not be mixed. Begin a new run without --resume.")
    return options


def _wrapped(notes: str) -> str:
    """Paragraphs, filled to the terminal's width."""
    columns = shutil.get_terminal_size().columns
    return "\n\n".join(textwrap.fill(" ".join(text.split()), columns, break_on_hyphens=False) for text in notes.split("\n\n"))


def _run(experiment: Experiment, options: argparse.Namespace) -> int:
    try:
        own = {key: value for key, value in vars(options).items() if key not in _NOT_OPTIONS}
        folder = options.resume or new_run(options.runs, experiment.name, own)
        with locked(folder):
            if options.resume:
                keep_options(folder, experiment.name, own)
            results = _results(experiment, options, folder)
            write(folder / RESULTS, results)
    except OSError as error:
        raise UserError(f"cannot write the run's folder: {error}; name another with --runs", ENVIRONMENT) from None
    except CellsFailed as error:
        raise UserError(f"{error}\nTry them again with `mobee experiment run {experiment.name} --resume {folder}`", FAILED) from None
    except KeyboardInterrupt:
        raise UserError(f"interrupted; go on with `mobee experiment run {experiment.name} --resume {folder}`", INTERRUPTED) from None
    if options.json:
        print(json.dumps({"run": str(folder), **results}, indent=2))
    else:
        print(f"run: {folder}")
        claims = [(experiment.name, Claim(**claim)) for claim in results.pop("claims", [])]
        print(results_text(results, shutil.get_terminal_size().columns))  # 80 in a pipe
        if claims:
            print(claims_text(claims, shutil.get_terminal_size().columns))
    return FAILED if results.get("passed") is False else 0


def _results(experiment: Experiment, options: argparse.Namespace, folder: Path) -> dict[str, Any]:
    try:
        return open_with_few_seeds(experiment.method.run(options, folder), vars(options))
    except MobeeError:
        if options.resume is None:
            discard_unused(folder)
        raise


def _claims(arguments: argparse.Namespace) -> int:
    if arguments.folders or not arguments.write:
        record = {**recorded(), **found_in(arguments.folders)}
    else:
        record = better(recorded(), found_in(finished_runs(arguments.runs)))
    if arguments.write:
        write_page(record)
    table = rows(record)
    if arguments.json:
        print(json.dumps([{"experiment": name, **claim.record()} for name, claim in table], indent=2))
    else:
        print(claims_text(table, shutil.get_terminal_size().columns))
    return 0


def _figure(arguments: argparse.Namespace) -> int:
    runs, name, folder = arguments.runs, arguments.name, arguments.folder
    if folder is None and current_name(name) not in EXPERIMENTS and Path(name).is_dir():
        name, folder = experiment_of(Path(name)), Path(name)
    experiment = load_experiment(name)
    path = experiment.method.figure(given_run(folder, runs, name) if folder else newest_run(runs, name))
    print(json.dumps({"figure": str(path)}) if arguments.json else path)
    return 0
