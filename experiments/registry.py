"""The experiments that `mobee experiment` knows: one line each."""

from __future__ import annotations

import argparse
import importlib
from pathlib import Path
from typing import Any, Protocol, cast

from mobee.errors import UnknownName

EXPERIMENTS = {
    "accuracy": "experiments.accuracy",
    "babbling": "experiments.babbling",
    "change": "experiments.change",
    "chapter7": "experiments.chapter7",
    "clauses": "experiments.clauses",
    "connectivity": "experiments.connectivity",
    "coverage": "experiments.coverage",
    "decay": "experiments.decay",
    "either-alone": "experiments.either_alone",
    "flood": "experiments.flood",
    "graze": "experiments.graze",
    "hypercube": "experiments.hypercube",
    "identify": "experiments.identify",
    "kail": "experiments.kail",
    "lattice": "experiments.lattice",
    "live-reach": "experiments.live_reach",
    "live-table": "experiments.live_table",
    "nes": "experiments.nes",
    "ngik": "experiments.ngik",
    "originals": "experiments.originals",
    "own-robots": "experiments.own_robots",
    "planner": "experiments.planner",
    "pregrasp": "experiments.pregrasp",
    "prm-vs-mdp": "experiments.prm_vs_mdp",
    "rank4": "experiments.rank4",
    "reach": "experiments.reach",
    "reach-predictors": "experiments.reach_predictors",
    "reach-vs-planners": "experiments.reach_vs_planners",
    "replanning": "experiments.replanning",
    "roadmap-from-scratch": "experiments.roadmap_from_scratch",
    "sensitivity": "experiments.sensitivity",
    "settle": "experiments.settle",
    "shove": "experiments.shove",
    "simultaneous": "experiments.simultaneous",
    "table": "experiments.table",
    "transfer": "experiments.transfer",
    "trm": "experiments.trm",
    "tune": "experiments.tune",
    "uniformity": "experiments.uniformity",
    "unmodelled": "experiments.unmodelled",
    "urdf-files": "experiments.urdf_files",
    "wall": "experiments.wall",
}

CHAPTER7 = (  # what `mobee experiment run chapter7` runs, in this order: thesis chapter 7 and section 3 of the paper
    "hypercube",
    "coverage",
    "lattice",
    "decay",
    "uniformity",
    "kail",
    "rank4",
    "change",
    "table",
    "planner",
)
BEYOND = ("accuracy", "connectivity", "prm-vs-mdp", "sensitivity")  # what its --all runs besides: what the works promise, and our own


class Experiment(Protocol):
    """What the module of an experiment holds.

    `run` works in the folder of a run and may be interrupted at any time: it appends what is finished to files there, and goes
    on behind them when it is called again.  A result `passed` of False fails the command.

    Optional: CLAIMS, the rows of the table of claims that it answers; their numbers are then in the results under "claims".
    """

    NAME: str
    CLAIM: str  # one line
    SOURCE: str

    def add_arguments(self, parser: argparse.ArgumentParser) -> None:
        """Options of the experiment; `--seed`, `--runs`, `--resume` and `--json` are there already."""

    def run(self, arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
        """Do it; returns what came out, of the types that JSON has."""

    def figure(self, folder: Path) -> Path:
        """Draw what a run left in its folder; returns the picture's path."""


def load_experiment(name: str) -> Experiment:
    """The experiment of that name; raises UnknownName with the nearest."""
    if name not in EXPERIMENTS:
        raise UnknownName("experiment", name, EXPERIMENTS)
    return cast(Experiment, importlib.import_module(EXPERIMENTS[name]))
