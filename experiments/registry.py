"""The experiments that `mobee experiment` knows: one line each."""

from __future__ import annotations

import importlib
from typing import cast

from experiments.kit.experiment import Experiment, Steps
from mobee.errors import UnknownName

EXPERIMENTS = {
    "accuracy": "experiments.claims.ch7_learning.accuracy",
    "babbling": "experiments.claims.ch4_reflex.babbling",
    "change": "experiments.claims.ch7_learning.change",
    "chapter7": "experiments.claims.ch7_learning.chapter7",
    "clauses": "experiments.claims.ch5_control.clauses",
    "connectivity": "experiments.claims.ch7_learning.connectivity",
    "coverage": "experiments.claims.ch7_learning.coverage",
    "decay": "experiments.claims.ch7_learning.decay",
    "either-alone": "experiments.claims.ch8_reaching.either_alone",
    "flood": "experiments.claims.ch2_model.flood",
    "graze": "experiments.claims.ch4_reflex.graze",
    "hypercube": "experiments.claims.ch7_learning.hypercube",
    "identify": "experiments.claims.ch5_control.identify",
    "kail": "experiments.claims.ch7_learning.kail",
    "lattice": "experiments.claims.ch7_learning.lattice",
    "live-reach": "experiments.claims.ch8_reaching.live_reach.claim",
    "live-table": "experiments.claims.ch7_learning.live_table",
    "nes": "experiments.claims.ch3_roadmaps.nes",
    "ngik": "experiments.claims.ch3_roadmaps.ngik",
    "originals": "experiments.originals",
    "own-robots": "experiments.own_robots",
    "planner": "experiments.claims.ch7_learning.planner",
    "pregrasp": "experiments.claims.ch8_reaching.pregrasp",
    "prm-vs-mdp": "experiments.claims.ch8_reaching.prm_vs_mdp",
    "rank4": "experiments.claims.ch7_learning.rank4",
    "reach": "experiments.claims.ch8_reaching.reach",
    "reach-predictors": "experiments.claims.ch8_reaching.reach_predictors",
    "reach-vs-planners": "experiments.claims.ch8_reaching.reach_vs_planners",
    "replanning": "experiments.claims.ch3_roadmaps.replanning",
    "roadmap-from-scratch": "experiments.claims.ch3_roadmaps.roadmap_from_scratch",
    "sensitivity": "experiments.claims.ch7_learning.sensitivity",
    "settle": "experiments.claims.ch5_control.settle",
    "shove": "experiments.claims.ch5_control.shove",
    "simultaneous": "experiments.claims.ch8_reaching.simultaneous",
    "table": "experiments.claims.ch7_learning.table",
    "transfer": "experiments.claims.ch7_learning.transfer",
    "trm": "experiments.claims.ch3_roadmaps.trm",
    "tune": "experiments.claims.ch5_control.tune",
    "uniformity": "experiments.claims.ch7_learning.uniformity",
    "unmodelled": "experiments.claims.ch8_reaching.unmodelled",
    "urdf-files": "experiments.urdf_files",
    "wall": "experiments.claims.ch5_control.wall",
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
