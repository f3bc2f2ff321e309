# SPDX-License-Identifier: Apache-2.0
"""The table of claims with the measured numbers of runs, written to experiments/README.md."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.kit.experiment import MIN_SEEDS, Claim, open_with_few_seeds
from experiments.kit.raw_records import keep_record, opened_record
from experiments.kit.run_folder import CONFIG, RESULTS, VERSIONS, read
from experiments.registry import BEYOND, CHAPTER7, EXPERIMENTS, current_name, load_experiment
from mobee.errors import InvalidValue

HERE = Path(__file__).parent
RECORD, PAGE = HERE / "claims.json", HERE / "README.md"
Rows = list[tuple[str, Claim]]  # the name of the experiment, and one of its claims
Recorded = dict[str, dict[str, Any]]  # by experiment: its claims as dicts, "commit", "seeds"

_INDENT = 11  # of the lines below a verdict

_HEAD = f"""\
# Experiments

Published claims, the numbers that this project measured, and verdicts. `mobee experiment claims --write` writes this page from
the runs with the most seeds, and of those from the newest; do not edit it.

An experiment is one module in `claims/`, by chapter of the thesis: its docstring states claim, source, published number and run time.
`mobee experiment list` lists them, `mobee experiment run NAME` runs one, `mobee experiment figure NAME` draws it, and
`mobee experiment run chapter7 --all` runs those of chapter 7. Numbers are interquartile means with 95 % bootstrap
intervals, unless stated otherwise; the last column has the number of seeds.

`records/` has the raw record of each run: the values of every seed, its settings and the commit. `mobee experiment claims --check` computes
all numbers and verdicts of this page from them again, and `mobee experiment figure NAME --record` draws the figure.

A sweep (`--seeds N`) uses all cores; each finished cell is written to disk, and `--resume` continues after Ctrl-C or a kill.
`--engine ray` (`pip install "mobee[cluster]"`) uses all machines of the Ray cluster that this machine belongs to, or this machine if there
is none; MoBeE must be installed on all of them in the same version. `--quick` runs a short version, to check that it works.

**confirmed**: our number agrees with the publication. **refuted**: it does not. **open**: it was not measured, does not decide, or has
fewer than {MIN_SEEDS} seeds.

Terms in the rows. **state-action**: one action in one state. **prior 50-50**: before its first try, an action is imagined to fail
once and to succeed once; **60-40**: to succeed twice. **constrained**, **free**: the left arm with its cable constraints and
self-contacts, and without both. **ghost**: a table that exerts no force. **P**: the probability that a run of the agent named first
is better than a run of the other, with ties counted half.

Where states have 16 neighbours, many samples have the same distance, and it is drawn at random which become neighbours. In
exploration-coverage and neighbour-count each seed draws its own graph. Elsewhere all seeds share one (tie seed 0): there the
intervals include noise, starts and random choices, but not the draw of the graph, and a result may be a property of that graph.
"""


def stated() -> Rows:
    """Return the claims of all experiments without measured numbers; those of chapter 7 first, in its order."""
    names = dict.fromkeys((*CHAPTER7, *BEYOND, *EXPERIMENTS))
    return [(name, claim) for name in names for claim in load_experiment(name).claims]


def recorded() -> Recorded:
    """Return the record from which the page was last written."""
    return {current_name(name): entry for name, entry in read(RECORD).items()} if RECORD.exists() else {}


def rows(record: Mapping[str, Mapping[str, Any]]) -> Rows:
    """Return every claim, with its measured number if there is one."""
    measured = {(name, c["source"], c["text"]): Claim(**c) for name, entry in record.items() for c in entry["claims"]}
    return [(name, measured.get((name, claim.source, claim.text), claim)) for name, claim in stated()]


def found_in(folders: Sequence[Path]) -> Recorded:
    """Return the measured claims of finished runs, including the parts of a chapter's run; see `better` for several runs.

    Raises InvalidValue for a folder without results.
    """
    found: Recorded = {}
    for name, entry, versions in _finished_in(folders):
        found = better(found, {name: _entry(entry, versions)})
    return found


def _entry(run: Path, versions: Path) -> dict[str, Any]:
    options = read(run / CONFIG)["options"]
    claims = open_with_few_seeds(read(run / RESULTS), options)["claims"]
    return {"seeds": options.get("seeds"), "commit": read(versions).get("commit"), "claims": claims}


def _finished_in(folders: Sequence[Path]) -> Iterator[tuple[str, Path, Path]]:
    """Yield the runs that have measured claims: experiment, folder, and file with the versions.

    The folder of a chapter's run has a folder for each of its experiments, and the versions for all of them.
    """
    for folder in folders:
        entries = [path.parent for path in (folder / RESULTS, *sorted(folder.glob(f"*/{RESULTS}"))) if path.exists()]
        if not entries:
            raise InvalidValue(f"{folder} has no results: finish the run with `mobee experiment run NAME --resume {folder}`.")
        for entry in entries:
            if read(entry / RESULTS).get("claims"):
                run = folder if (folder / VERSIONS).exists() else folder.parent
                yield current_name(read(entry / CONFIG)["experiment"]), entry, run / VERSIONS


def better(before: Recorded, after: Recorded) -> Recorded:
    """Merge two records: of each experiment the one with more seeds, and `after` if both have equally many."""
    more = {name: one for name, one in after.items() if name not in before or (one["seeds"] or 0) >= (before[name]["seeds"] or 0)}
    return {**before, **more}


def finished_runs(runs: Path) -> list[Path]:
    """Return the folders of runs with results, without --quick runs, the oldest first."""
    folders = sorted({path.parent for path in runs.glob(f"*/{CONFIG}")}, key=lambda folder: folder.name)
    return [folder for folder in folders if current_name(read(folder / CONFIG).get("experiment", "")) in EXPERIMENTS and _counts(folder)]


def _counts(run: Path) -> bool:
    is_finished = (run / RESULTS).exists() or any(run.glob(f"*/{RESULTS}"))
    return is_finished and not read(run / CONFIG)["options"].get("quick")


def keep_records(folders: Sequence[Path], record: Recorded) -> None:
    """Write the raw records of the runs whose numbers are in the record; raises InvalidValue for a run that is too large."""
    for name, run, versions in _finished_in(folders):
        if record.get(name) == _entry(run, versions):
            keep_record(name, run, versions, load_experiment(name).method.kept)


def recomputed(name: str) -> list[dict[str, str]]:
    """Return the claims of an experiment, computed from its raw record; raises InvalidValue if there is none."""
    with opened_record(name) as run:
        claims: list[dict[str, str]] = open_with_few_seeds(load_experiment(name).method.results(run), read(run / CONFIG)["options"])[
            "claims"
        ]
        return claims


def differences(name: str, entry: Mapping[str, Any]) -> list[str]:
    """Compare the raw record of an experiment with its entry in the table; returns a line for each difference."""
    try:
        found = {claim["text"]: claim for claim in recomputed(name)}
        with opened_record(name) as run:
            commit, seeds = read(run / VERSIONS).get("commit"), read(run / CONFIG)["options"].get("seeds")
    except InvalidValue as error:
        return [str(error)]
    lines = [
        f"{name}: the table has {key} {entry[key]}, the record {value}"
        for key, value in (("commit", commit), ("seeds", seeds))
        if value != entry[key]
    ]
    for claim in entry["claims"]:
        own = found.get(claim["text"])
        for key in ("ours", "verdict"):
            if own is None or own[key] != claim[key]:
                value = "no such claim" if own is None else own[key]
                lines.append(f"{name}, {claim['text']!r}: the table has {key} {claim[key]!r}, the record gives {value!r}")
    return lines


def write_page(record: Recorded) -> None:
    """Write the record and the page."""
    kept = {name: record[name] for name in sorted(record) if name in EXPERIMENTS}
    RECORD.write_text(json.dumps(kept, indent=1) + "\n")
    PAGE.write_text(page(kept))


def page(record: Recorded) -> str:
    """Return the page as Markdown."""
    table = rows(record)
    counts = Counter(claim.verdict for _, claim in table)
    lines = [_HEAD, f"{len(table)} claims: {counts['confirmed']} confirmed, {counts['refuted']} refuted, {counts['open']} open.", ""]
    lines += ["| source | claim | published | ours | verdict | experiment |", "| --- | --- | --- | --- | --- | --- |"]
    for name, claim in table:
        seeds = record.get(name, {}).get("seeds")
        runs = f"{name}, {seeds} seeds" if seeds and claim.ours else name
        cells = (claim.source, claim.text, claim.published, claim.ours or "not measured", f"**{claim.verdict}**", runs)
        lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
    return "\n".join(lines) + "\n"


def claims_text(table: Sequence[tuple[str, Claim]], width: int) -> str:
    """Return the claims as text for a terminal: each with its verdict, and the numbers below."""
    lines = []
    for _, claim in table:
        parts = (f"{claim.text} ({claim.source})", f"published: {claim.published}", f"ours: {claim.ours or 'not measured'}")
        filled = [textwrap.fill(text, width - _INDENT, break_long_words=False, break_on_hyphens=False) for text in parts]
        lines.append(f"{claim.verdict:<{_INDENT}}" + "\n".join(filled).replace("\n", "\n" + " " * _INDENT))
    return "\n".join(lines)
