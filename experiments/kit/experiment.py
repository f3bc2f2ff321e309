# SPDX-License-Identifier: Apache-2.0
"""An experiment: the claims that it tests, their sources and verdicts, and the method."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from experiments.kit.cells import reduced_cells
from experiments.kit.statistics import error_rate
from mobee.errors import InvalidValue, UnknownName

OUR_AIM = "aim of this reproduction"
"""Text in the source of a claim that is not published but an aim of our own: the verdict on an aim is "met", "not met" or "open"."""
Verdict = Literal["confirmed", "stronger", "depends", "not reproduced", "refuted", "open", "met", "not met"]
"""The verdict on a claim or on an aim of our own: VERDICTS states what each one means, and `verdict_of` when it is given."""
VERDICTS: Mapping[Verdict, str] = {
    "confirmed": "our numbers agree with the publication",
    "stronger": "the effect has the published direction, and is larger than published",
    "depends": "the claim holds in some of the settings that the publications leave open, and fails in others",
    "not reproduced": "the claim fails here, but in one setting only, or something that the publications leave open was not varied",
    "refuted": "the claim fails in every setting that the publications leave open, and at least two were measured",
    "open": "not measured, not decided by the intervals, not distinguished from chance among all rows, or too few repetitions",
    "met": "an aim of our own that is reached",
    "not met": "an aim of our own that is not reached",
}
Holds = bool | None | Literal["stronger"]
"""Whether a claim holds; None: the intervals do not decide it; "stronger": it holds, and the effect is larger than published."""


@dataclass(frozen=True)
class Envelope:
    """The outcomes of a claim in several settings; the publications leave open which setting was used.

    `what`: what differs between the settings, as "unit of distance".  `holds`: the outcome in each setting, by the setting's name, as "1
    cm": True, False, None (not decided) or "stronger" (the effect is larger than published).
    """

    what: str
    holds: Mapping[str, Holds]


Measured = tuple[str, Holds | Envelope]
"""The result of a rule: our numbers with their intervals as text, and whether the claim holds, in one setting or in each."""
Rule = Callable[[Any], Measured | None]
"""Function of an experiment's runs, in the form in which the experiment groups them; returns `Measured`, or None for too few runs."""
MIN_SEEDS = 5  # repetitions for a verdict: a bootstrap interval of fewer values is too narrow
_WORDS: Mapping[Holds, str] = {True: "holds", "stronger": "stronger than published", None: "open", False: "fails"}
_PAIR = " / "  # between the names of two settings that vary together


def verdict_of(holds: Holds | Envelope, is_aim: bool = False, untested: bool = True) -> Verdict:
    """Return the verdict on a claim from its outcome in one setting, or from its outcomes in several settings.

    An aim of our own is "not met" if it fails in any setting, else "open" if any outcome is None or there is no setting, else "met".  A
    published claim gets the first of these that applies:

    - "depends": it holds in some settings and fails in others.
    - "open": an outcome is None, or there is no setting.
    - "refuted": it fails in all settings, there are at least two, and `untested` is false.
    - "not reproduced": it fails in all settings.
    - "stronger": the outcome is "stronger" in all settings.
    - "confirmed": it holds in all settings.

    Args:
        holds: the outcome in the only setting; or an Envelope with the outcome of each setting.
        is_aim: whether the claim is an aim of our own.
        untested: whether an untested setting could explain a failure: the publications leave it open, and the experiment did not vary
            it.
    """
    each = list(holds.holds.values()) if isinstance(holds, Envelope) else [holds]
    fails, undecided = False in each, None in each or not each
    if is_aim:
        return "not met" if fails else "open" if undecided else "met"
    if fails and (True in each or "stronger" in each):
        return "depends"
    if undecided:
        return "open"
    if fails:
        return "refuted" if len(each) > 1 and not untested else "not reproduced"
    return "stronger" if set(each) == {"stronger"} else "confirmed"


def in_settings(what: str, rule: Rule, settings: Mapping[str, Any]) -> Measured | None:
    """Judge a claim by its rule in each of several settings; returns None if the rule returns None in all settings.

    A rule returns None if there are too few runs.  `what`: what differs between the settings, as "unit of distance".  `settings`: the runs
    in each setting, by its name.

    Returns a text and an outcome.  The text has our numbers in the first setting, and in each other setting whose outcome differs from that
    of the first.  The outcome is an Envelope with the outcome of each setting; if only one setting has enough runs, it is that setting's
    outcome.

    The rule may vary something else inside each setting (the inner settings), and return an Envelope of them.  If this Envelope is the same
    in all settings, it is the outcome.  If not, the outcome is one Envelope with an entry for each pair of a setting and an inner setting.
    """
    each = {name: found for name, runs in settings.items() if (found := rule(runs)) is not None}
    if not each:
        return None
    (_, (text, first)), *others = each.items()
    text = "; ".join([text, *(f"with {name}: {other}" for name, (other, holds) in others if holds != first)])
    if len(each) == 1:
        return text, first
    plain = {name: holds for name, (_, holds) in each.items() if not isinstance(holds, Envelope)}
    if len(plain) == len(each):
        return text, Envelope(what, plain)
    inner = {name: holds for name, (_, holds) in each.items() if isinstance(holds, Envelope)}
    if all(envelope == first for envelope in inner.values()) and len(inner) == len(each):
        return text, first
    both = {f"{outer}{_PAIR}{name}": found for outer, envelope in inner.items() for name, found in envelope.holds.items()}
    return text, Envelope(f"{what}{_PAIR}{next(iter(inner.values())).what}", both | plain)


def _by_setting(envelope: Envelope) -> str:
    """Return in which settings the claim holds and fails, as text."""
    grouped = {word: [name for name, holds in envelope.holds.items() if holds == found] for found, word in _WORDS.items()}
    each = (f"{word} for {', '.join(_merged(names, list(envelope.holds)))}" for word, names in grouped.items() if names)
    return f"{envelope.what}: {'; '.join(each)}"


def _merged(names: Sequence[str], every: Sequence[str]) -> list[str]:
    """Shorten a list of names of settings, in which "A / B" is a pair of an outer setting A and an inner setting B.

    If `names` contain all pairs of A that `every`, the names of all settings, contain, then "A" replaces these pairs.
    """
    firsts = [name.partition(_PAIR)[0] for name in every]
    whole = {first for first in firsts if all(name in names for name, its in zip(every, firsts, strict=True) if its == first)}
    return list(dict.fromkeys(first if (first := name.partition(_PAIR)[0]) in whole else name for name in names))


@dataclass(frozen=True)
class Claim:
    """A row of the table of claims.

    The results of an experiment have its measured claims, as dicts, under "claims"; `judged` makes these dicts.

    Args:
        source: where the claim was published, as "thesis 7.2.1, fig. 7.5"; contains OUR_AIM ("aim of this reproduction") if it is ours.
        text: the claim.
        published: the published number.
        ours: our numbers with their intervals.
        verdict: one of VERDICTS, which states their meanings.
        settings: in which settings the claim holds and in which it fails, as text; "" if it is judged in one setting.
        p: p value of the verdict.  The error rate of an interval is one minus its confidence level; p is the smallest error rate, at least
            MIN_RATE (0.001), with which the verdict is the same as with 0.05.  1: the verdict is open with 0.05; None: the verdict uses no
            interval.
        rule: function that measures and judges the claim: the function below the decorator `claim`, or one of experiments.kit.rules.
        varies: what differs between the settings in which the claim is judged, as "unit of distance"; the rule gets the runs of one
            setting, and the experiment groups its runs by setting.  "": there is one setting, or the rule itself returns an Envelope.
        untested: settings that could explain a failure, as text: the publications leave them open, and no run varies them; "" if there
            are none.
    """

    source: str
    text: str
    published: str
    ours: str = ""
    verdict: Verdict = "open"
    settings: str = ""
    p: float | None = None
    rule: Rule | None = field(default=None, compare=False, repr=False, kw_only=True)
    varies: str = field(default="", compare=False, kw_only=True)
    untested: str = field(default="", compare=False, kw_only=True)

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Verdict):
            raise UnknownName("verdict", self.verdict, get_args(Verdict))

    @property
    def is_aim(self) -> bool:
        """Whether the claim is not published but an aim of our own."""
        return OUR_AIM in self.source

    def measured(self, ours: str, holds: Holds | Envelope) -> Claim:
        """Return the claim with the text `ours` of the measured numbers, and with the verdict that follows from `holds`."""
        settings = _by_setting(holds) if isinstance(holds, Envelope) else ""
        return replace(self, ours=ours, verdict=verdict_of(holds, self.is_aim, bool(self.untested)), settings=settings)

    def undecided(self, why: str) -> Claim:
        """Return the claim with the verdict "open" and with the reason `why` after its numbers; an open claim is returned unchanged."""
        return self if self.verdict == "open" else replace(self, ours=f"{self.ours} ({why})", verdict="open")

    def record(self) -> dict[str, Any]:
        """Return the claim as a dict for JSON, by field; the fields `rule`, `varies` and `untested` are left out."""
        return {name: getattr(self, name) for name in ("source", "text", "published", "ours", "verdict", "settings", "p")}


def claim(source: str, text: str, published: str, varies: str = "", untested: str = "") -> Callable[[Rule], Claim]:
    """Return a decorator that turns a rule (a function that measures and judges) into a `Claim`; the arguments are fields of `Claim`."""
    return lambda rule: Claim(source, text, published, rule=rule, varies=varies, untested=untested)


def judged(claims: Iterable[Claim], runs: Any, complete: bool = True) -> list[dict[str, Any]]:
    """Return the claims as dicts (see `Claim.record`), measured and judged by their rules from `runs`.

    `runs`: the runs, in the form that the rules of the experiment take.  `complete`: whether the runs suffice.  If they do not, the rules
    are not called, and the claims are returned without measured numbers.
    """
    return [(_by_rule(claim, runs) if complete else claim).record() for claim in claims]


def _by_rule(claim: Claim, runs: Any) -> Claim:
    if claim.rule is None:
        return claim
    rule = partial(in_settings, claim.varies, claim.rule) if claim.varies else claim.rule

    def key(measured: Measured | None) -> object:
        return measured and verdict_of(measured[1], claim.is_aim, bool(claim.untested))

    measured, rate = error_rate(lambda: rule(runs), key)
    if measured is None:
        return claim
    found = claim.measured(*measured)
    return replace(found, p=1.0 if rate is not None and found.verdict == "open" else rate)


class Method(Protocol):
    """The functions that run an experiment and draw its figure.

    `run` writes into the folder of a run.  It may be interrupted at any time: finished parts are on disk, and the next call continues after
    them.  If the results that it returns have the value False under "passed", the command `mobee experiment run` fails.
    """

    @property
    def kept(self) -> tuple[str, ...]:
        """Glob patterns of the files from which `results` and `figure` compute; these files of a run are kept in the repository."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options of the experiment to the parser, which has `--seed`, `--runs`, `--resume` and `--json` already."""

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Run the experiment with the options in `arguments`, and return its results as JSON values.

        `folder`: folder of the run, into which `run` writes each part of the run that is finished.
        """

    def recorded(self, folder: Path) -> AbstractContextManager[Path]:
        """Return a context manager that yields a folder with the files for the raw record of a finished run.

        The raw record is an archive in the repository.  It has those files of the yielded folder that match `kept`; the results can be
        computed from them again.  `folder`: folder of the run; usually it is also the yielded folder.  If the experiment keeps only a
        summary of its values, a temporary folder is yielded.  Its files have the summary in place of the values.  It is deleted when the
        context ends.
        """

    def results(self, folder: Path) -> dict[str, Any]:
        """Compute the results of a run from the files in its folder.

        Only files that match a pattern in `kept` are read; the repository keeps them.  Raises InvalidValue if the experiment keeps none.
        """

    def figure(self, folder: Path) -> Path:
        """Draw the results of the run in `folder`, and return the path of the picture."""


@dataclass(frozen=True)
class Steps:
    """A `Method` made of functions, for an experiment that is not a sweep.

    `add_arguments`, `run`, `figure`, `kept`: as in `Method`.  `recomputed`: function that computes the results from the folder of a run;
    None for an experiment without claims.  `summary`: function that returns a summary of the values of a cell (a finished part of a run).
    The raw record, which is the archive of a run in the repository, then has the summaries in place of the values; if `summary` is None, it
    has the values.  A summary is possible only if the files that match `kept` are cells.  The results must be the same with the summaries,
    and the summary of a summary must be equal to it.
    """

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Path], dict[str, Any]]
    figure: Callable[[Path], Path]
    recomputed: Callable[[Path], dict[str, Any]] | None = None
    kept: tuple[str, ...] = ()
    summary: Callable[[dict[str, Any]], dict[str, Any]] | None = None

    def recorded(self, folder: Path) -> AbstractContextManager[Path]:
        """Return a context manager that yields the folder with the files for the raw record of a run, as in `Method.recorded`.

        It is the run's folder.  If there is a `summary`, it is a temporary folder with the run's cells (its finished parts), in which
        summaries stand in place of the values.
        """
        return nullcontext(folder) if self.summary is None else reduced_cells(folder, self.summary)

    def results(self, folder: Path) -> dict[str, Any]:
        """Compute the results of a run from the files in its folder, by the function `recomputed`.

        Only the files kept in the repository (those that match `kept`) are read.  Raises InvalidValue if `recomputed` is None: the
        experiment has no claims.
        """
        if self.recomputed is None:
            raise InvalidValue(f"{folder}: this experiment has no claims, and keeps no record from which its results are computed.")
        return self.recomputed(folder)


@dataclass(frozen=True)
class Experiment:
    """An experiment as `mobee experiment` lists and runs it; the module of an experiment has one as EXPERIMENT.

    Attributes:
        claim: one line that states what the experiment tests.
        source: the publication that states the claim.
        method: the functions that run the experiment and draw its figure.
        claims: the experiment's rows in the table of claims, without numbers; the results of a run contain them with numbers, under the key
            "claims".
        repeats: name of the option with the number of repetitions of a run; with fewer than MIN_SEEDS (5) no claim is decided.
        name: name of the experiment on the command line, set by `experiments.registry`.
        notes: docstring of the module, with claim, source, published numbers and run time, set by `experiments.registry`.
    """

    claim: str
    source: str
    method: Method
    claims: tuple[Claim, ...] = ()
    repeats: str = "seeds"
    name: str = ""
    notes: str = ""

    def repetitions(self, made: int | None) -> str:
        """Return the number of repetitions of a run as text: "10 seeds", "1 seed" or "no seeds".

        `made`: the number; 0 and None give "no seeds".  The word "seeds" stands for the name of the option in `repeats`.
        """
        return f"{made or 'no'} {self.repeats.removesuffix('s') if made == 1 else self.repeats}"

    def decided(self, results: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
        """Return the results of a run; all claims of a short or small run in them become open and keep their numbers.

        A run is short if it was started with --quick, and small if it has fewer than MIN_SEEDS (5) repetitions.  `results`: the results as
        the experiment computed them; they are not changed.  `options`: the options of the run, by name.
        """
        made, is_short = options.get(self.repeats), options.get("quick", False)
        if "claims" not in results or (made is not None and made >= MIN_SEEDS and not is_short):
            return dict(results)
        why = "a short version, without a verdict" if is_short else f"{self.repetitions(made)}, too few for a verdict"
        return {**results, "claims": [Claim(**claim).undecided(why).record() for claim in results["claims"]]}
