"""The table of claims: what experiments state, filled in with what their runs found (experiments/README.md)."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from experiments.kit.experiment import MIN_SEEDS, Claim, open_with_few_seeds
from experiments.kit.run_folder import CONFIG, RESULTS, VERSIONS, read
from experiments.registry import BEYOND, CHAPTER7, EXPERIMENTS, current_name, load_experiment
from mobee.errors import InvalidValue

HERE = Path(__file__).parent
RECORD, PAGE = HERE / "claims.json", HERE / "README.md"
Rows = list[tuple[str, Claim]]  # the name of the experiment, and one of its claims
Recorded = dict[str, dict[str, Any]]  # by experiment: its claims as dicts, "commit", "seeds"

_INDENT = 11  # of what stands below a verdict

_HEAD = f"""\
# Experiments

What was published, what this project measured, and whether it holds. `mobee experiment claims --write` writes this page from
the runs with the most seeds, of those the newest; do not edit it.

An experiment is one module in `claims/`, by chapter of the thesis: its docstring states claim, source, published number and run time.
`mobee experiment list` names them, `mobee experiment run NAME` runs one, `mobee experiment figure NAME` draws it, and
`mobee experiment run chapter7` does all that the table below needs. Numbers are interquartile means with 95 % bootstrap
intervals, unless they say otherwise; how many runs they rest on is in the last column.

A sweep (`--seeds N`) works on all cores; each finished cell is on disk at once, and `--resume` goes on behind them after Ctrl-C or a
kill. `--engine ray` (`pip install \"mobee[cluster]\"`) works on the Ray cluster that this machine belongs to, on all its machines, and on
this machine alone if there is none; MoBeE must be installed on each of them in the same version. `--quick` shows whether it works.

**confirmed**: our number is what was published. **refuted**: it is not. **open**: it was not measured, does not decide, or rests on
fewer than {MIN_SEEDS} seeds.

Where states have 16 neighbours, many samples are equally far, and which become neighbours is drawn. In exploration-coverage and
neighbour-count each seed draws its own graph. Everywhere else all seeds share one (tie seed 0): there the intervals cover noise,
starts and ties of choice, not the draw of the graph, and what the numbers say may be a property of that graph.
"""


def stated() -> Rows:
    """The claims that the experiments list, without our numbers; those of chapter 7 first, in its order."""
    names = dict.fromkeys((*CHAPTER7, *BEYOND, *EXPERIMENTS))
    return [(name, claim) for name in names for claim in load_experiment(name).claims]


def recorded() -> Recorded:
    """What the page was last written from."""
    return {current_name(name): entry for name, entry in read(RECORD).items()} if RECORD.exists() else {}


def rows(record: Mapping[str, Mapping[str, Any]]) -> Rows:
    """Every claim stated, with our number where there is one."""
    measured = {(name, c["source"], c["text"]): Claim(**c) for name, entry in record.items() for c in entry["claims"]}
    return [(name, measured.get((name, claim.source, claim.text), claim)) for name, claim in stated()]


def found_in(folders: Sequence[Path]) -> Recorded:
    """The claims of finished runs, of a chapter's parts too; `better` says which of several counts.

    Raises InvalidValue for a folder without results.
    """
    found: Recorded = {}
    for folder in folders:
        entries = [path.parent for path in (folder / RESULTS, *sorted(folder.glob(f"*/{RESULTS}"))) if path.exists()]
        if not entries:
            raise InvalidValue(f"{folder} has no results: finish it with `mobee experiment run NAME --resume {folder}`.")
        for entry in entries:
            config = read(entry / CONFIG)
            claims = open_with_few_seeds(read(entry / RESULTS), config["options"]).get("claims")
            if claims:
                run = folder if (folder / VERSIONS).exists() else folder.parent  # a part of chapter7 has it in the whole's folder
                seeds, commit = config["options"].get("seeds"), read(run / VERSIONS).get("commit")
                found = better(found, {current_name(config["experiment"]): {"seeds": seeds, "commit": commit, "claims": claims}})
    return found


def better(before: Recorded, after: Recorded) -> Recorded:
    """Of each experiment the record with more seeds, and `after` where they have as many."""
    more = {name: one for name, one in after.items() if name not in before or (one["seeds"] or 0) >= (before[name]["seeds"] or 0)}
    return {**before, **more}


def finished_runs(runs: Path) -> list[Path]:
    """The runs that are finished, at least in part, and no --quick ones, the oldest first."""
    folders = sorted({path.parent for path in runs.glob(f"*/{CONFIG}")}, key=lambda folder: folder.name)
    return [folder for folder in folders if current_name(read(folder / CONFIG).get("experiment", "")) in EXPERIMENTS and _counts(folder)]


def _counts(run: Path) -> bool:
    is_finished = (run / RESULTS).exists() or any(run.glob(f"*/{RESULTS}"))
    return is_finished and not read(run / CONFIG)["options"].get("quick")


def write_page(record: Recorded) -> None:
    """Keep the numbers, and write the page from them."""
    kept = {name: record[name] for name in sorted(record) if name in EXPERIMENTS}
    RECORD.write_text(json.dumps(kept, indent=1) + "\n")
    PAGE.write_text(page(kept))


def page(record: Recorded) -> str:
    """The page as Markdown."""
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
    """For a terminal: each claim with its verdict, and below it the numbers."""
    lines = []
    for _, claim in table:
        parts = (f"{claim.text} ({claim.source})", f"published: {claim.published}", f"ours: {claim.ours or 'not measured'}")
        filled = [textwrap.fill(text, width - _INDENT, break_long_words=False, break_on_hyphens=False) for text in parts]
        lines.append(f"{claim.verdict:<{_INDENT}}" + "\n".join(filled).replace("\n", "\n" + " " * _INDENT))
    return "\n".join(lines)
