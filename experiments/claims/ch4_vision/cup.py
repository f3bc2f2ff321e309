# SPDX-License-Identifier: Apache-2.0
"""The cup: reach a pre-grasp beside a cup among clutter, close the hand, lift the cup and put it down elsewhere, in MuJoCo.

Claim: adaptive roadmap planning "works well in practice, generating reaches to objects".  Source: thesis 4.3.3, figs. 4.8 and 4.9.
Published: pictures of a cup, no numbers, and no grasp.  Our goals: at least 90 % of the placements end in a pre-grasp within 2 cm and 15
degrees with nothing knocked over, and at least 75 % lift and place.

A seed draws the place of the cup (5.6 cm wide, 13 cm high, 150 g) and 0 to 3 pieces of clutter; the cameras do not see the first piece.
Placements without room for the open hand beside the cup are drawn again.  Cup and clutter move when they are pushed.  The places that the
cameras report have random errors, with a standard deviation of 2 mm along x and y.  Everything runs in one process: the model, the
controller with the default gains, and MuJoCo in ticks of 10 ms.  The motors have lag, delay, play and encoder noise; the largest torques of
the finger motors are 0.09 and 0.3 N m.  As in a reach, contacts of the fields (larger volumes around the links, which cause repulsive
forces) with the cup and with the seen clutter exert no force on the hand.  A jump of the torques of shoulder and waist is a bump: the arm
moves back, and on the next path the palm moves around or over the place of the bump.

There are three planners of the path to the pre-grasp.  "map": A* over the free edges of a map of pre-grasps.  "learner": an agent that has
learned to reach from 300 tries (a plan and then a reach to a target) on the offline plant without clutter, and moves only the arm.  "rrt":
inverse kinematics with RRT-Connect of OMPL.  Grasp, lift and placing are the same for all.

The settings of grip, bumps and motions were chosen by the results of seeds below 520; the reported results are those of seeds from 520 on.
Run time: 5 s of processor time for a trial.  Needs the extras `sim` and `planning`.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from experiments.kit.cup.trial import ANGLE, LIFTED, NEAR, run_trial
from experiments.kit.experiment import OUR_AIM, Claim, Experiment, Measured, judged
from experiments.kit.plots import finish, new_figure
from experiments.kit.rules import decides
from experiments.kit.statistics import share_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee.roadmap.ompl import require_ompl

MAP = "map"
ENOUGH = {"pre_grasp": 0.9, "done": 0.75}  # shares of the placements
QUICK = 2  # placements of a short version
WHOLE = 100  # placements of each planner, with which the claims are judged
METHODS = {MAP: "pre-grasp map", "learner": "learned reacher", "rrt": "inverse kinematics and RRT-Connect"}

Runs = Sequence[Mapping[str, Any]]


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return a condition of the sweep for each planner of the path to the pre-grasp (the keys of METHODS).

    With --quick there are two seeds.
    """
    seeds = tuple(range(arguments.seed, arguments.seed + QUICK)) if arguments.quick else ()
    return [Condition(name, {"method": name}, seeds=seeds) for name in METHODS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let the robot grasp, lift and place a cup once, with the planner `settings["method"]`: "map", "learner" or "rrt".

    `seed`: of the scene, the errors of the cameras and the plant.  Returns the fields of `experiments.kit.cup.trial.Result` by name.
    """
    return run_trial(settings["method"], seed)


def _share(runs: Runs, name: str) -> tuple[float, float, float]:
    """Return the share of the trials with a result, such as `lifted`, and its 95 % interval."""
    count = sum(bool(run[name]) for run in runs)
    return count / len(runs), *share_interval(count, len(runs))


def _text(runs: Runs, name: str) -> str:
    share, low, high = _share(runs, name)
    return f"{share:.2f} [{low:.2f}, {high:.2f}]"


def _reasons(runs: Runs) -> dict[str, int]:
    found: dict[str, int] = {}
    for run in runs:
        if run["why"]:
            found[run["why"]] = found.get(run["why"], 0) + 1
    return dict(sorted(found.items(), key=lambda item: -item[1]))


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "planners", a dict from the planner to a dict of its measures; "ended", for each planner a dict from each reason of failure to the
    number of trials that failed for this reason; "claims", a list with the judged claims, as dicts (`Claim.record`).  Among the measures,
    "planning, ms" is the processor time of all plans of a trial, median; "distance, mm" and "angle, deg" are None if no trial came to the
    pre-grasp.
    """
    rows: dict[str, Any] = {}
    reasons: dict[str, Any] = {}
    groups = grouped(found, "method", tuple(METHODS))
    for name, runs in groups.items():
        came = [run for run in runs if run["distance"] >= 0.0]
        rows[METHODS[name]] = {
            "placements": len(runs),
            "pre-grasp": _text(runs, "pre_grasp"),
            "lifted": _text([run | {"up": run["lifted"] >= LIFTED} for run in map(dict, runs)], "up"),
            "lifted and placed": _text(runs, "done"),
            "distance, mm": round(1e3 * float(np.median([run["distance"] for run in came])), 1) if came else None,
            "angle, deg": round(float(np.rad2deg(np.median([run["angle"] for run in came]))), 1) if came else None,
            "knocked over": sum(bool(run["knocked"]) for run in runs),
            "bumps": sum(int(run["bumps"]) for run in runs),
            "planning, ms": round(1e3 * float(np.median([run["planning"] for run in runs])), 0),
            "robot time, s": round(float(np.median([run["seconds"] for run in runs])), 0),
        }
        reasons[METHODS[name]] = _reasons(runs)
    whole = len(groups) == len(METHODS) and min(map(len, groups.values())) >= WHOLE
    return {"planners": rows, "ended": reasons, "claims": judged(CLAIMS, groups, whole)}


def _pre_grasps(groups: Mapping[str, Runs]) -> Measured:
    return _often(groups, "pre_grasp")


def _placed(groups: Mapping[str, Runs]) -> Measured:
    return _often(groups, "done")


def _often(groups: Mapping[str, Runs], name: str) -> Measured:
    _, low, high = _share(groups[MAP], name)
    text = "; ".join(f"{METHODS[key]} {_text(group, name)}" for key, group in groups.items())
    return text, decides((low, high), least=ENOUGH[name])


CLAIMS = (
    Claim(
        OUR_AIM,
        "among clutter, a part of it unseen, the pre-grasp map brings the palm to within 2 cm and 15 degrees of its place beside a cup, "
        "with nothing knocked over: share of placements",
        f"at least {ENOUGH['pre_grasp']:.2f}",
        rule=_pre_grasps,
    ),
    Claim(
        OUR_AIM,
        "from the pre-grasp map the hand closes around the cup, lifts it and puts it down elsewhere, where it stands: share of placements",
        f"at least {ENOUGH['done']:.2f}",
        rule=_placed,
    ),
)


def plot(found: Cells) -> Any:
    """Return a figure of the shares of success, and of the distances and angles of the palm at the pre-grasp, for each planner."""
    groups = grouped(found, "method", tuple(METHODS))
    drawing = new_figure(9.0, 3.4)
    left, right = drawing.subplots(1, 2)
    names = [METHODS[name].replace(" and ", "\nand ") for name in groups]
    for aside, (key, label, color) in enumerate((("pre_grasp", "pre-grasp", "C0"), ("done", "lifted and placed", "C2"))):
        shares, low, high = np.array([_share(runs, key) for runs in groups.values()]).T
        places = np.arange(len(groups)) + 0.16 * aside - 0.08
        left.errorbar(places, shares, [shares - low, high - shares], fmt="o", color=color, capsize=3, label=label)
    left.set_xticks(range(len(names)), names)
    finish(left, legend=8.0, ylabel="share of placements", ylim=(0.0, 1.02))
    left.tick_params(axis="x", labelsize=7)
    for number, (name, runs) in enumerate(groups.items()):
        came = [run for run in runs if run["distance"] >= 0.0]
        at = [1e3 * run["distance"] for run in came], [np.rad2deg(run["angle"]) for run in came]
        right.plot(*at, "o", color=f"C{number}", markersize=3, label=METHODS[name])
    right.axvline(1e3 * NEAR, color="0.5", linestyle="--", linewidth=1.0)
    right.axhline(np.rad2deg(ANGLE), color="0.5", linestyle="--", linewidth=1.0)
    finish(right, legend=7.0, xlabel="palm from its place, mm", ylabel="palm from its direction, deg", xscale="log", yscale="log")
    return drawing


EXPERIMENT = Experiment(
    claim="a hand reaches the pre-grasp beside a cup among clutter, closes around it, and puts it down elsewhere",
    source="thesis 4.3.3, figs. 4.8, 4.9",
    method=Sweep(conditions, trial, findings, plot, seeds=WHOLE, require=require_ompl),
    claims=CLAIMS,
)
