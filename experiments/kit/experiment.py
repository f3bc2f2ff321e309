"""An experiment: the claims that it tests, their sources and verdicts, and the method."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Literal, Protocol, get_args

from mobee.errors import UnknownName

Verdict = Literal["confirmed", "refuted", "open"]
LEAST_SEEDS = 5  # for a verdict: a bootstrap of fewer values is too narrow, of one it has no width


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
        """With our number; it holds, does not, or that is open (None)."""
        return replace(self, ours=ours, verdict="open" if holds is None else "confirmed" if holds else "refuted")

    def record(self) -> dict[str, str]:
        """As a dict for JSON."""
        return asdict(self)


def open_with_few_seeds(results: Mapping[str, Any], options: Mapping[str, Any]) -> dict[str, Any]:
    """Results of an experiment with its claims open, where its runs have too few `seeds` for a verdict; the numbers stay."""
    seeds = options.get("seeds")
    if seeds is None or seeds >= LEAST_SEEDS or "claims" not in results:
        return dict(results)
    return {**results, "claims": [_undecided(Claim(**claim), seeds).record() for claim in results["claims"]]}


def _undecided(claim: Claim, seeds: int) -> Claim:
    if claim.verdict == "open":
        return claim
    return claim.measured(f"{claim.ours} ({seeds} {'seed' if seeds == 1 else 'seeds'}, too few for a verdict)", None)


class Method(Protocol):
    """How an experiment is done.

    `run` works in the folder of a run and may be interrupted at any time: what is finished is on disk there, and it goes on
    behind that when it is called again.  A result `passed` of False fails the command.
    """

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Options of the experiment; `--seed`, `--runs`, `--resume` and `--json` are there already."""

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Do it; returns the results, of the types that JSON has."""

    def figure(self, folder: Path) -> Path:
        """Draw what a run left in its folder; returns the picture's path."""


@dataclass(frozen=True)
class Steps:
    """A method of three functions, for what is not a sweep; see `Method`."""

    add_arguments: Callable[[argparse.ArgumentParser], None]
    run: Callable[[argparse.Namespace, Path], dict[str, Any]]
    figure: Callable[[Path], Path]


@dataclass(frozen=True)
class Experiment:
    """What `mobee experiment` lists and runs; a module of a claim holds one as EXPERIMENT.

    `claim`: one line.  `notes`: the module's docstring, which states claim, source, published numbers and run time.
    `claims`: the rows of the table of claims that it answers; their numbers are then in the results under "claims".
    """

    name: str
    claim: str
    source: str
    notes: str
    method: Method
    claims: tuple[Claim, ...] = ()
