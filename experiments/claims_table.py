# SPDX-License-Identifier: Apache-2.0
"""The table of claims with the measured numbers of runs, written to experiments/README.md."""

from __future__ import annotations

import json
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from experiments import chapters
from experiments.frozen_rules import CONFIRMING_SEED, require_frozen
from experiments.kit.experiment import MIN_SEEDS, VERDICTS, Claim
from experiments.kit.raw_records import TooLarge, all_records, keep_record, opened_record, record_path
from experiments.kit.run_folder import CONFIG, RESULTS, VERSIONS, experiment_of, options_of, read
from experiments.kit.statistics import RATES
from experiments.registry import BEYOND, CHAPTER7, EXPERIMENTS, current_name, load_experiment
from mobee.errors import InvalidValue

HERE = Path(__file__).parent
RECORD, PAGE = HERE / "claims.json", HERE / "README.md"
Rows = list[tuple[str, Claim]]  # the name of the experiment, and one of its claims
Entry = dict[str, Any]  # claims as dicts, "commit", "seeds"
Recorded = dict[str, Entry]  # by experiment; "confirmed": the entry of the run with new seeds, if there is one

FALSE_DISCOVERIES = RATES[0]  # expected share of wrong verdicts among all verdicts by intervals
CONFIRMED = "confirmed"
_INDENT = 16  # of the lines below a verdict

_HEAD = f"""\
# Experiments

Claims of Mikhail Frank's thesis (2014) and of the paper by Frank, Leitner, Stollenga, Förster and Schmidhuber (2014), the numbers that this
project measured, and verdicts. `mobee experiment claims --write` writes this page from
the runs with the most seeds, and of those from the newest; do not edit it. [Results](../docs/results.md#the-thesis-chapter-by-chapter) is
the summary, chapter by chapter.

An experiment is one module in `claims/`, by chapter of the thesis: its docstring states claim, source, published number and run time.
`mobee experiment list` lists them, `mobee experiment run NAME` runs one, `mobee experiment figure NAME` draws it, and
`mobee experiment run chapter7 --all` runs those of chapter 7. Numbers are interquartile means with 95 % bootstrap
intervals, unless stated otherwise; the last column has the number of seeds.

`records/` has the raw record of each run: the values of every seed, its settings and the commit. `mobee experiment claims --check` computes
all numbers and verdicts of this page from them again, and `mobee experiment figure NAME --record` draws the figure. A row without a record
is open.

A sweep (`--seeds N`) uses all cores; each finished cell is written to disk, and `--resume` continues after Ctrl-C or a kill.
`--engine ray` (`pip install "mobee[cluster]"`) uses all machines of the Ray cluster that this machine belongs to, or this machine if there
is none; MoBeE must be installed on all of them in the same version. `--quick` runs a short version, without verdicts.

## Verdicts

| verdict | meaning |
| --- | --- |
{chr(10).join(f"| {verdict} | {meaning} |" for verdict, meaning in VERDICTS.items())}

- Intervals decide, never estimates: a claim holds if the whole interval lies within its bounds, and fails if the whole interval lies
  outside.
- That two things are equal is confirmed by an equivalence test: the whole interval of their difference lies within a stated margin.
- A claim is one row. Where the publications leave a setting open, the row has the verdict of each setting, and its text the numbers.
- A verdict needs {MIN_SEEDS} repetitions or more.
- The p value of a row is one minus the highest confidence level of its intervals at which it still has its verdict. By
  Benjamini and Hochberg's procedure over all rows, a row whose p value is too large is open, so that at most
  {100 * FALSE_DISCOVERIES:.0f} % of the verdicts by intervals are expected to be wrong.
- [frozen.json](frozen.json) has the constants of the rules, among them the thresholds. After they were frozen, some experiments were run
  once more with seeds from {CONFIRMING_SEED} on (`mobee experiment run NAME --seed {CONFIRMING_SEED} --seeds 30`); the column "new seeds"
  has these verdicts.

## Terms

**state-action**: one action in one state. **prior 50-50**: before its first try, an action is imagined to fail once
and to succeed once; **60-40**: to fail once and to succeed twice (counts start at 1, so they are 2 and 3, or 40 and
60 %). **'Kail' divergence**: the information gain with which the thesis rewards an action, the KL divergence of the
belief after an observation from the belief before it ([learning](../docs/learning.md)). **hypercube**: four motors
with two positions each, 16 states with 4 actions each. **settle speed**: the speed below which an action counts as
ended. **cable force**: the largest force of the constraints of the shoulder's cables. **constrained**, **free**: the
left arm with its cable constraints and self-contacts, and without both. **ghost**: a table that exerts no force.
**P**: the probability that a run of the agent named first is better than a run of the other, with ties counted half.
In brackets after a verdict: what the publications leave open, with the values with which the claim holds, is open, or
fails.

An action leads from one state, a posture, to a near one, its neighbour. Where states have 16 neighbours, many other states have the same
distance, and it is drawn at random which of them become neighbours: the graph. In
exploration-coverage and neighbour-count each seed draws its own graph. Elsewhere all seeds share one (tie seed 0): there the
intervals include noise, starts and random choices, but not the draw of the graph, and a result may be a property of that graph.
"""


def stated() -> Rows:
    """Return all claims without measured numbers, as pairs of the experiment's name and the claim; those of chapter 7 come first."""
    names = dict.fromkeys((*CHAPTER7, *BEYOND, *EXPERIMENTS))
    return [(name, claim) for name in names for claim in load_experiment(name).claims]


def recorded() -> Recorded:
    """Return the table entries in claims.json, by the experiment's name; {} if the file does not exist.

    An entry has the measured claims, the number of seeds and the commit of a run.  `write_page` writes this file together with
    experiments/README.md.
    """
    return {current_name(name): entry for name, entry in read(RECORD).items()} if RECORD.exists() else {}


def rows(record: Mapping[str, Mapping[str, Any]], confirms: bool = False) -> Rows:
    """Return all claims as pairs of the experiment's name and the claim, with numbers and verdicts if they are recorded.

    `record`: the table's entries, by the experiment's name.  `confirms`: take the numbers of the later runs with new seeds, which confirm
    the first runs, instead of those of the first runs.  A claim becomes open if its p value is above the limit that `largest_rate` computes
    from the p values of all claims.
    """
    entries = {name: entry.get(CONFIRMED, {}) if confirms else entry for name, entry in record.items()}
    measured = {(name, c["source"], c["text"]): Claim(**c) for name, entry in entries.items() for c in entry.get("claims", ())}
    table = [(name, measured.get((name, claim.source, claim.text), claim)) for name, claim in stated()]
    most = largest_rate([claim.p for _, claim in table if claim.p is not None])
    why = f"not distinguished from chance among all rows: p {{:g}}, at most {most:.3f}"
    return [(name, claim.undecided(why.format(claim.p)) if claim.p is not None and claim.p > most else claim) for name, claim in table]


def largest_rate(p: Sequence[float]) -> float:
    """Return the largest p value that a decision may have, by the procedure of Benjamini and Hochberg (1995); 0 if all are rejected.

    Decisions with larger p values are rejected.  The expected share of wrong decisions among the others is at most FALSE_DISCOVERIES
    (0.05).  `p`: the p values of all decisions.
    """
    ordered = sorted(p)
    allowed = [FALSE_DISCOVERIES * rank / len(ordered) for rank in range(1, len(ordered) + 1)]
    return max((most for value, most in zip(ordered, allowed, strict=True) if value <= most), default=0.0)


class Finished(NamedTuple):
    """A finished run.

    `entry`: its entry in the table of claims: measured claims, number of seeds, commit.  `run`: its folder.  `versions`: path of the file
    with the versions of the software.
    """

    entry: Entry
    run: Path
    versions: Path


def runs_in(folders: Sequence[Path]) -> dict[str, Finished]:
    """Return a dict from the name of each experiment in these folders to its finished run; runs whose results have no claims are ignored.

    A folder is that of an experiment's run, or that of a chapter's run, which has a folder for each experiment.  Of several runs of one
    experiment, the one with the most seeds is returned; if several have the most seeds, the last of them.  Raises InvalidValue for a folder
    without results.
    """
    found: dict[str, Finished] = {}
    for name, run, versions in _finished_in(folders):
        one = Finished(_entry(name, run, versions), run, versions)
        if name not in found or _counts_more(one.entry, found[name].entry):
            found[name] = one
    return found


def entries_of(found: Mapping[str, Finished]) -> Recorded:
    """Return the table entries of finished runs, by the experiment's name."""
    return {name: one.entry for name, one in found.items()}


def _entry(name: str, run: Path, versions: Path) -> Entry:
    """Return the entry of a run; its claims are computed from its files by the present rules where they can be."""
    experiment, options = load_experiment(name), options_of(run, name)
    is_kept = any(any(run.glob(pattern)) for pattern in experiment.method.kept)
    try:
        results = experiment.method.results(run) if is_kept else read(run / RESULTS)
    except KeyError as error:
        raise InvalidValue(f"{run} was made by another version of {name!r}: it has no {error}. Run the experiment again.") from None
    claims = experiment.decided(results, options)["claims"]
    return {"seeds": options.get(experiment.repeats), "commit": read(versions).get("commit"), "claims": claims}


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
                yield current_name(experiment_of(entry)), entry, run / VERSIONS


def _counts_more(one: Entry, before: Entry) -> bool:
    return bool((one["seeds"] or 0) >= (before["seeds"] or 0))


def better(before: Recorded, after: Recorded) -> Recorded:
    """Return both records merged: each experiment has the entry with more seeds, and that of `after` if both have equally many."""
    return replaced(before, {name: one for name, one in after.items() if name not in before or _counts_more(one, before[name])})


def replaced(before: Recorded, after: Recorded) -> Recorded:
    """Return the record `before` with the entries of `after` in place of those with the same names.

    An entry can have a part "confirmed": the entry of a later run with new seeds.  This part is kept from `before` if the entry of `after`
    has none.
    """
    kept = {name: {CONFIRMED: entry[CONFIRMED]} for name, entry in before.items() if CONFIRMED in entry}
    return before | {name: kept.get(name, {}) | entry for name, entry in after.items()}


def with_confirmed(record: Recorded, found: Recorded) -> Recorded:
    """Return the record with the entries `found` of confirming runs, which have new seeds.

    Each one is stored in the entry of its experiment, under the key "confirmed".
    """
    return record | {name: {**record.get(name, {"seeds": None, "commit": None, "claims": []}), CONFIRMED: found[name]} for name in found}


def finished_runs(runs: Path, confirms: bool = False) -> list[Path]:
    """Return the folders of the finished runs in the folder `runs`, the oldest first; runs with --quick are left out.

    `confirms`: True: only the runs with new seeds (from CONFIRMING_SEED, 1000, on); False: only the other runs.
    """
    folders = sorted({path.parent for path in runs.glob(f"*/{CONFIG}")}, key=lambda folder: folder.name)
    known = [folder for folder in folders if current_name(read(folder / CONFIG).get("experiment", "")) in EXPERIMENTS and _counts(folder)]
    return [folder for folder in known if _confirms(folder) == confirms]


def _counts(run: Path) -> bool:
    is_finished = (run / RESULTS).exists() or any(run.glob(f"*/{RESULTS}"))
    return is_finished and not options_of(run, experiment_of(run)).get("quick")


def _confirms(run: Path) -> bool:
    return int(options_of(run, experiment_of(run)).get("seed", 0)) >= CONFIRMING_SEED


def require_seeds(folders: Sequence[Path], confirms: bool) -> None:
    """Raise InvalidValue if a run has seeds of the wrong kind, or is a short one; new seeds are those from CONFIRMING_SEED (1000) on.

    `folders`: the folders of the runs.  `confirms`: True: all runs must have new seeds; False: no run may have new seeds.
    """
    for folder in folders:
        if options_of(folder, experiment_of(folder)).get("quick"):
            raise InvalidValue(f"{folder} was started with --quick: the table takes whole runs only. Start one without --quick.")
        if _confirms(folder) != confirms:
            said = f"seeds below {CONFIRMING_SEED}, which confirm nothing: leave --confirm out" if confirms else "new seeds: add --confirm"
            raise InvalidValue(f"{folder} has {said}.")


def keep_records(found: Mapping[str, Finished], record: Recorded, confirms: bool = False) -> list[str]:
    """Write the raw records of runs, archives with the values of all seeds, into experiments/records.

    Runs whose numbers are not in the table are ignored.  `found`: the runs by the experiment's name.  `record`: the table's entries.
    `confirms`: whether the runs have new seeds.  Returns a message for each run whose raw record is too large; the raw records of the
    others are written.  Raises InvalidValue for a run with new seeds if the experiment's rules differ from the frozen ones (see
    `require_frozen`), or if another run with new seeds is recorded already.
    """
    failed = []
    for name, one in found.items():
        entry = record[name][CONFIRMED] if confirms else {key: value for key, value in record[name].items() if key != CONFIRMED}
        if entry == one.entry:
            if confirms:
                require_frozen(name)
            method = load_experiment(name).method
            with method.recorded(one.run) as folder:
                try:
                    keep_record(name, one.run, one.versions, method.kept, confirms, folder)
                except TooLarge as error:
                    failed.append(str(error))
    return failed


def recomputed(name: str, confirms: bool = False) -> Entry:
    """Return the table entry of an experiment, computed from its raw record, the archive of a run; raises InvalidValue if there is none.

    `confirms`: use the raw record of the later run with new seeds, which confirms the first run.
    """
    with opened_record(name, confirms) as run:
        return _entry(name, run, run / VERSIONS)


def differences(name: str, entry: Mapping[str, Any], confirms: bool = False) -> list[str]:
    """Compare the table entry of an experiment with its raw record (the archive of the run); returns a line of text for each difference.

    Without a raw record, each claim of the entry that is not open is a difference.  `confirms`: use the raw record of the later run with
    new seeds, which confirms the first run.
    """
    label = f"{name}, new seeds" if confirms else name
    if not record_path(name, confirms).exists():
        return [f"{label}, {c['text']!r}: {c['verdict']} without a raw record" for c in entry["claims"] if c["verdict"] != "open"]
    try:
        own = recomputed(name, confirms)
    except InvalidValue as error:
        return [str(error)]
    lines = [f"{label}: the table has {key} {entry[key]}, the record {own[key]}" for key in ("commit", "seeds") if own[key] != entry[key]]
    found = {claim["text"]: claim for claim in own["claims"]}
    for claim in entry["claims"]:
        for key in ("ours", "verdict", "settings", "p"):
            value = found[claim["text"]][key] if claim["text"] in found else "no such claim"
            if value != claim[key]:
                lines.append(f"{label}, {claim['text']!r}: the table has {key} {claim[key]!r}, the record gives {value!r}")
    return lines


def all_differences(record: Recorded) -> list[str]:
    """Compare the entries of the table with the raw records (archives of the runs); returns a line of text for each difference.

    A raw record without an entry in the table is a difference, too.
    """
    lines = [line for name, entry in record.items() for line in differences(name, entry)]
    lines += [line for name, entry in record.items() if CONFIRMED in entry for line in differences(name, entry[CONFIRMED], True)]
    known = {record_path(name) for name in record} | {record_path(name, True) for name, entry in record.items() if CONFIRMED in entry}
    return lines + [f"{path.name}: a raw record without an entry in the table" for path in all_records() if path not in known]


def write_page(record: Recorded) -> None:
    """Write the record to claims.json, the table to experiments/README.md, and the claims by chapter of the thesis into docs/results.md.

    The claims of an experiment without a raw record (the archive of its run) become open.  Raises InvalidValue outside a clone of the
    repository.
    """
    if not chapters.PAGE.exists():
        raise InvalidValue(f"there is no {chapters.PAGE}: the table is written in a clone of the repository.")
    kept = {name: _recorded_only(name, record[name]) for name in sorted(record) if name in EXPERIMENTS}
    RECORD.write_text(json.dumps(kept, indent=1) + "\n")
    PAGE.write_text(page(kept))
    chapters.PAGE.write_text(chapters.with_section(chapters.PAGE.read_text(), chapters_text(kept)))


def _recorded_only(name: str, entry: Entry) -> Entry:
    if record_path(name).exists():
        return entry
    return entry | {"claims": [Claim(**claim).undecided("no raw record").record() for claim in entry["claims"]]}


def page(record: Recorded) -> str:
    """Return the text of experiments/README.md as Markdown: the claims of the thesis and the paper, then our own aims.

    `record`: the entries of the table of claims, by the experiment's name.
    """
    table, confirming = rows(record), dict(_keyed(rows(record, confirms=True)))
    lines = [_HEAD]
    for title, is_aim in (("Claims of the thesis and the paper", False), ("Aims of our own", True)):
        chosen = [(name, claim) for name, claim in table if claim.is_aim == is_aim]
        lines += [f"## {title}", "", f"{len(chosen)}: {counts_text(chosen)}.", ""]
        lines += ["| source | claim | published | ours | verdict | new seeds | experiment |", "| --- | --- | --- | --- | --- | --- | --- |"]
        for name, claim in chosen:
            seeds = record.get(name, {}).get("seeds")
            runs = f"{name}, {load_experiment(name).repetitions(seeds)}" if seeds and claim.ours else name
            again = confirming.get((name, claim.text))
            new = f"{again.verdict}: {again.ours}" if again is not None and again.ours else ""
            verdict = f"**{claim.verdict}**" + (f" ({claim.settings})" if claim.settings else "")
            cells = (claim.source, claim.text, claim.published, claim.ours or "not measured", verdict, new, runs)
            lines.append(f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |")
        lines.append("")
    return "\n".join(lines).rstrip() + "\n"


def chapters_text(record: Recorded) -> str:
    """Return the published claims by chapter of the thesis as Markdown, with the numbers of the record."""
    untested = {(name, claim.text): claim.untested for name, claim in stated()}
    return chapters.section(rows(record), lambda name, text: untested[name, text])


def counts_text(table: Rows) -> str:
    """Return the number of claims with each verdict as text, as "12 confirmed, 3 open"."""
    counts = Counter(claim.verdict for _, claim in table)
    return ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])


def _keyed(table: Rows) -> Iterator[tuple[tuple[str, str], Claim]]:
    return (((name, claim.text), claim) for name, claim in table)


def claims_text(table: Sequence[tuple[str, Claim]], width: int) -> str:
    """Return the claims as text for a terminal of `width` columns: verdict, claim and source, published number, our number, settings."""
    lines = []
    for _, claim in table:
        parts = [f"{claim.text} ({claim.source})", f"published: {claim.published}", f"ours: {claim.ours or 'not measured'}"]
        parts += [claim.settings] if claim.settings else []
        filled = [textwrap.fill(text, width - _INDENT, break_long_words=False, break_on_hyphens=False) for text in parts]
        lines.append(f"{claim.verdict:<{_INDENT}}" + "\n".join(filled).replace("\n", "\n" + " " * _INDENT))
    return "\n".join(lines)
