# SPDX-License-Identifier: Apache-2.0
"""The names of the experiments of `mobee experiment`, and the modules that hold them."""

from __future__ import annotations

import importlib
from dataclasses import replace
from typing import cast

from experiments.kit.experiment import Experiment
from mobee.errors import UnknownName

EXPERIMENTS = {
    "babbling": "experiments.claims.ch4_reflex.babbling",
    "changed-actions": "experiments.claims.ch7_learning.changed_actions",
    "changed-outcomes": "experiments.claims.ch7_learning.changed_outcomes",
    "changed-worlds": "experiments.claims.ch8_reaching.changed_worlds",
    "changed-worlds-live": "experiments.claims.ch8_reaching.changed_worlds_live",
    "chapter7": "experiments.claims.ch7_learning.chapter7",
    "constraint-discovery": "experiments.claims.ch7_learning.constraint_discovery",
    "constraint-violations": "experiments.claims.ch5_control.constraint_violations",
    "cup": "experiments.claims.ch4_vision.cup",
    "curious-cup": "experiments.claims.ch7_learning.curious_cup",
    "exploration-coverage": "experiments.claims.ch7_learning.exploration_coverage",
    "exploration-uniformity": "experiments.claims.ch7_learning.exploration_uniformity",
    "forced-contact": "experiments.claims.ch5_control.forced_contact",
    "gain-tuning": "experiments.claims.ch5_control.gain_tuning",
    "hand-eye-calibration": "experiments.claims.ch4_vision.hand_eye_calibration",
    "hypercube-exploration": "experiments.claims.ch7_learning.hypercube_exploration",
    "information-gain": "experiments.claims.ch7_learning.information_gain",
    "live-reach": "experiments.claims.ch8_reaching.live_reach.claim",
    "live-table-discovery": "experiments.claims.ch7_learning.live_table_discovery",
    "mdp-planner": "experiments.claims.ch7_learning.mdp_planner",
    "model-accuracy": "experiments.claims.ch7_learning.model_accuracy",
    "model-throughput": "experiments.claims.ch2_model.model_throughput",
    "motor-identification": "experiments.claims.ch5_control.motor_identification",
    "neighbour-count": "experiments.claims.ch7_learning.neighbour_count",
    "nes": "experiments.claims.ch3_roadmaps.nes",
    "ngik": "experiments.claims.ch3_roadmaps.ngik",
    "object-localisation": "experiments.claims.ch4_vision.object_localisation",
    "originals": "experiments.claims.robot_files.originals",
    "own-robots": "experiments.claims.robot_files.own_robots",
    "planner-reach-ablation": "experiments.claims.ch8_reaching.planner_reach_ablation",
    "plant-sensitivity": "experiments.claims.ch7_learning.plant_sensitivity",
    "prm-vs-mdp": "experiments.claims.ch8_reaching.prm_vs_mdp",
    "push-disturbance": "experiments.claims.ch5_control.push_disturbance",
    "reach-exploration": "experiments.claims.ch8_reaching.reach_exploration",
    "reach-predictors": "experiments.claims.ch8_reaching.reach_predictors",
    "reach-under-model-error": "experiments.claims.ch8_reaching.reach_under_model_error",
    "reach-vs-planners": "experiments.claims.ch8_reaching.reach_vs_planners",
    "replanning": "experiments.claims.ch3_roadmaps.replanning",
    "reward-decay": "experiments.claims.ch7_learning.reward_decay",
    "roadmap-density": "experiments.claims.ch8_reaching.roadmap_density",
    "roadmap-from-scratch": "experiments.claims.ch3_roadmaps.roadmap_from_scratch",
    "robots-teaching-robots": "experiments.claims.ch4_vision.robots_teaching_robots",
    "shallow-contact-recovery": "experiments.claims.ch4_reflex.shallow_contact_recovery",
    "shared-workspace": "experiments.claims.ch4_reflex.shared_workspace",
    "simulation-transfer": "experiments.claims.ch7_learning.simulation_transfer",
    "simultaneous-learning": "experiments.claims.ch8_reaching.simultaneous_learning",
    "step-response": "experiments.claims.ch5_control.step_response",
    "table-discovery": "experiments.claims.ch7_learning.table_discovery",
    "tabular-exploration": "experiments.claims.ch7_learning.tabular_exploration",
    "trm": "experiments.claims.ch3_roadmaps.trm",
    "unreachable-states": "experiments.claims.ch7_learning.unreachable_states",
    "urdf-files": "experiments.claims.robot_files.urdf_files",
    "zoo": "experiments.claims.robot_files.zoo",
}

FORMER_NAMES = {  # still accepted, and read in the records of older runs
    "accuracy": "model-accuracy",
    "change": "changed-outcomes",
    "clauses": "constraint-violations",
    "connectivity": "neighbour-count",
    "coverage": "exploration-coverage",
    "decay": "reward-decay",
    "either-alone": "planner-reach-ablation",
    "flood": "model-throughput",
    "graze": "shallow-contact-recovery",
    "hypercube": "hypercube-exploration",
    "identify": "motor-identification",
    "kail": "information-gain",
    "lattice": "constraint-discovery",
    "live-table": "live-table-discovery",
    "planner": "mdp-planner",
    "pregrasp": "roadmap-density",
    "rank4": "unreachable-states",
    "reach": "reach-exploration",
    "sensitivity": "plant-sensitivity",
    "settle": "step-response",
    "shove": "push-disturbance",
    "simultaneous": "simultaneous-learning",
    "table": "table-discovery",
    "transfer": "simulation-transfer",
    "tune": "gain-tuning",
    "uniformity": "exploration-uniformity",
    "unmodelled": "reach-under-model-error",
    "wall": "forced-contact",
}

CHAPTER7 = (  # run in this order by `mobee experiment run chapter7`: thesis chapter 7 and section 3 of the paper
    "hypercube-exploration",
    "exploration-coverage",
    "constraint-discovery",
    "reward-decay",
    "exploration-uniformity",
    "information-gain",
    "unreachable-states",
    "changed-outcomes",
    "table-discovery",
    "mdp-planner",
)
BEYOND = ("model-accuracy", "neighbour-count", "prm-vs-mdp", "plant-sensitivity")  # run by its --all too: other claims, and our own studies


def current_name(name: str) -> str:
    """Return the current name of an experiment, given its current or a former name; other names are returned unchanged."""
    return FORMER_NAMES.get(name, name)


def all_names(name: str) -> tuple[str, ...]:
    """Return the current name of an experiment and its former names."""
    current = current_name(name)
    return (current, *(former for former, new in FORMER_NAMES.items() if new == current))


def load_experiment(name: str) -> Experiment:
    """Return the experiment with this current or former name; for any other name raises UnknownName, which suggests the nearest name."""
    name = current_name(name)
    if name not in EXPERIMENTS:
        raise UnknownName("experiment", name, EXPERIMENTS)
    module = importlib.import_module(EXPERIMENTS[name])
    return replace(cast(Experiment, module.EXPERIMENT), name=name, notes=module.__doc__ or "")
