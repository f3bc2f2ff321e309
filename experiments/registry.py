"""The experiments that `mobee experiment` knows: one line each."""

from __future__ import annotations

import importlib
from typing import cast

from experiments.kit.experiment import Experiment, Steps
from mobee.errors import UnknownName

EXPERIMENTS = {
    "accuracy": "experiments.accuracy",
    "babbling": "experiments.babbling",
    "change": "experiments.change",
    "chapter7": "experiments.claims.ch7_learning.chapter7",
    "clauses": "experiments.clauses",
    "connectivity": "experiments.connectivity",
    "coverage": "experiments.coverage",
    "decay": "experiments.claims.ch7_learning.decay",
    "either-alone": "experiments.claims.ch8_reaching.either_alone",
    "flood": "experiments.flood",
    "graze": "experiments.graze",
    "hypercube": "experiments.hypercube",
    "identify": "experiments.identify",
    "kail": "experiments.kail",
    "lattice": "experiments.lattice",
    "live-reach": "experiments.claims.ch8_reaching.live_reach.claim",
    "live-table": "experiments.live_table",
    "nes": "experiments.nes",
    "ngik": "experiments.ngik",
    "originals": "experiments.originals",
    "own-robots": "experiments.own_robots",
    "planner": "experiments.planner",
    "pregrasp": "experiments.claims.ch8_reaching.pregrasp",
    "prm-vs-mdp": "experiments.claims.ch8_reaching.prm_vs_mdp",
    "rank4": "experiments.rank4",
    "reach": "experiments.claims.ch8_reaching.reach",
    "reach-predictors": "experiments.claims.ch8_reaching.reach_predictors",
    "reach-vs-planners": "experiments.claims.ch8_reaching.reach_vs_planners",
    "replanning": "experiments.replanning",
    "roadmap-from-scratch": "experiments.roadmap_from_scratch",
    "sensitivity": "experiments.sensitivity",
    "settle": "experiments.settle",
    "shove": "experiments.shove",
    "simultaneous": "experiments.claims.ch8_reaching.simultaneous",
    "table": "experiments.table",
    "transfer": "experiments.transfer",
    "trm": "experiments.trm",
    "tune": "experiments.tune",
    "uniformity": "experiments.uniformity",
    "unmodelled": "experiments.claims.ch8_reaching.unmodelled",
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


def load_experiment(name: str) -> Experiment:
    """The experiment of that name; raises UnknownName with the nearest."""
    if name not in EXPERIMENTS:
        raise UnknownName("experiment", name, EXPERIMENTS)
    module = importlib.import_module(EXPERIMENTS[name])
    if hasattr(module, "EXPERIMENT"):
        return cast(Experiment, module.EXPERIMENT)
    method = Steps(module.add_arguments, module.run, module.figure)
    return Experiment(module.NAME, module.CLAIM, module.SOURCE, module.__doc__ or "", method, getattr(module, "CLAIMS", ()))
