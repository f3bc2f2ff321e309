# SPDX-License-Identifier: Apache-2.0
"""An experiment: the claims that it tests, their sources and verdicts, and the method."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from mobee.errors import UnknownName

Verdict = Literal["confirmed", "refuted", "open"]
MIN_SEEDS = 5  # for a verdict: a bootstrap interval of fewer values is too narrow


@dataclass(frozen=True)
class Claim:
    """A row of the table of claims.

    An experiment lists its claims as CLAIMS = (Claim(source, text, published), ...), and returns them measured, as dicts, under
    "claims" in its results.  `source`: where it was published, as "thesis 7.2.1, fig. 7.5".  `ours`: our number with its interval.
    """

    source: str
    text: str
    published: str
    ours: str = ""
    verdict: Verdict = "open"

    def __post_init__(self) -> None:
        if self.verdict not in get_args(Verdict):
            raise UnknownName("verdict", self.verdict, get_args(Verdict))

    def measured(self, ours: str, holds: bool | None) -> Claim:
        """Return the claim with the measured number `ours`; `holds` is None where the measurement does not decide it."""
        return replace(self, ours=ours, verdict="open" if holds is None else "confirmed" if holds else "refuted")

    def record(self) -> dict[str, str]:
        """Return the claim as a dict for JSON."""
        return asdict(self)


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

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Add the options of the experiment; `--seed`, `--runs`, `--resume` and `--json` exist already."""

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Run the experiment; returns its results as JSON values."""

    def figure(self, folder: Path) -> Path:
        """Draw the results in the folder of a run; returns the path of the picture."""


@dataclass(frozen=True)
class Steps:
    """A method made of three functions, for an experiment that is not a sweep; see `Method`."""

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Path], dict[str, Any]]
    figure: Callable[[Path], Path]


@dataclass(frozen=True)
class Experiment:
    """An experiment as `mobee experiment` lists and runs it; the module of a claim holds one as EXPERIMENT.

    `claim`: one line.  `notes`: the module's docstring, which states claim, source, published numbers and run time.
    `claims`: its rows in the table of claims; their measured numbers are in the results under "claims".
    """

    name: str
    claim: str
    source: str
    notes: str
    method: Method
    claims: tuple[Claim, ...] = ()
