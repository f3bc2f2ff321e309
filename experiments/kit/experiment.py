# SPDX-License-Identifier: Apache-2.0
"""An experiment: the claims that it tests, their sources and verdicts, and the method."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from mobee.errors import InvalidValue, UnknownName

Verdict = Literal["confirmed", "refuted", "open"]
Measured = tuple[str, bool | None]
"""Our number with its interval as text, and whether the claim holds; None: the measurement does not decide it."""
Rule = Callable[[Any], Measured | None]
"""Computes `Measured` from the runs of an experiment, in the form in which the experiment groups them; None: they are too few."""
MIN_SEEDS = 5  # for a verdict: a bootstrap interval of fewer values is too narrow


@dataclass(frozen=True)
class Claim:
    """A row of the table of claims.

    An experiment returns its claims measured, as dicts, under "claims" in its results; see `judged`.
    `source`: where it was published, as "thesis 7.2.1, fig. 7.5".  `ours`: our number with its interval.  `rule`: how the experiment
    measures and judges it, a function of its own below the decorator `claim`, or one of experiments.kit.rules.
    """

    source: str
    text: str
    published: str
    ours: str = ""
    verdict: Verdict = "open"
    rule: Rule | None = field(default=None, compare=False, repr=False, kw_only=True)

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Verdict):
            raise UnknownName("verdict", self.verdict, get_args(Verdict))

    def measured(self, ours: str, holds: bool | None) -> Claim:
        """Return the claim with the measured number `ours`; `holds` is None where the measurement does not decide it."""
        return replace(self, ours=ours, verdict="open" if holds is None else "confirmed" if holds else "refuted")

    def record(self) -> dict[str, str]:
        """Return the claim as a dict for JSON, without its rule."""
        return {name: getattr(self, name) for name in ("source", "text", "published", "ours", "verdict")}


def claim(source: str, text: str, published: str) -> Callable[[Rule], Claim]:
    """Return a decorator that makes a rule the claim that it measures."""
    return lambda rule: Claim(source, text, published, rule=rule)


def judged(claims: Iterable[Claim], runs: Any, complete: bool = True) -> list[dict[str, str]]:
    """Return the claims as dicts, measured by their rules from the runs; none is measured unless the runs are `complete`."""
    return [(_by_rule(claim, runs) if complete else claim).record() for claim in claims]


def _by_rule(claim: Claim, runs: Any) -> Claim:
    measured = claim.rule(runs) if claim.rule else None
    return claim.measured(*measured) if measured else claim


def open_with_few_seeds(results: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Return results in which all claims are open if the run had fewer than MIN_SEEDS `seeds`; the numbers are kept."""
    seeds = options.get("seeds")
    if seeds is None or seeds >= MIN_SEEDS or "claims" not in results:
        return dict(results)
    return {**results, "claims": [_undecided(Claim(**claim), seeds).record() for claim in results["claims"]]}


def _undecided(claim: Claim, seeds: int) -> Claim:
    if claim.verdict == "open":
        return claim
    return claim.measured(f"{claim.ours} ({seeds} {'seed' if seeds == 1 else 'seeds'}, too few for a verdict)", None)


class Method(Protocol):
    """The functions that run an experiment and draw its figure.

    `run` writes into the folder of a run and may be interrupted at any time: finished parts are on disk, and the next call
    continues after them.  If its result `passed` is False, the command fails.
    """

    @property
    def kept(self) -> tuple[str, ...]:
        """Glob patterns of the files from which `results` and `figure` compute: the record of a run (see experiments.kit.raw_records)."""

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options of the experiment; `--seed`, `--runs`, `--resume` and `--json` exist already."""

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Run the experiment; returns its results as JSON values."""

    def results(self, folder: Path) -> dict[str, Any]:
        """Compute the results of a finished run from its `kept` files; raises InvalidValue if the experiment keeps none."""

    def figure(self, folder: Path) -> Path:
        """Draw the results in the folder of a run; returns the path of the picture."""


@dataclass(frozen=True)
class Steps:
    """A method made of functions, for an experiment that is not a sweep; see `Method`.

    `recomputed`: computes `results` from the files `kept`; None for an experiment without claims.
    """

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Path], dict[str, Any]]
    figure: Callable[[Path], Path]
    recomputed: Callable[[Path], dict[str, Any]] | None = None
    kept: tuple[str, ...] = ()

    def results(self, folder: Path) -> dict[str, Any]:
        """Compute the results from the `kept` files in the folder."""
        if self.recomputed is None:
            raise InvalidValue(f"{folder}: this experiment has no claims, and keeps no record from which its results are computed.")
        return self.recomputed(folder)


@dataclass(frozen=True)
class Experiment:
    """An experiment as `mobee experiment` lists and runs it; the module of a claim holds one as EXPERIMENT.

    `claim`: one line.  `claims`: its rows in the table of claims; their measured numbers are in the results under "claims".  `name` and
    `notes`, the docstring of the module, which states claim, source, published numbers and run time, are set by `experiments.registry`.
    """

    claim: str
    source: str
    method: Method
    claims: tuple[Claim, ...] = ()
    name: str = ""
    notes: str = ""
