"""An experiment: a claim, its source, and the method that tests it."""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

from experiments.kit.claims import Claim


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
