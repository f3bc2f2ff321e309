# SPDX-License-Identifier: Apache-2.0
"""Two robots in one workspace: iCub and Katana babble beside each other, each with its own protection, in one common model (thesis 4.1.2).

Claim: robots that share a model and have a controller each do not collide.  Source: thesis 4.1.2: two reflexes, synchronised "by adjusting
the control frequency. That is, the speed with which the reflex controller indexes through the history buffer"; then "the reflexive
responses of both are synchronous, and the stochastic collection of training data runs robustly for hours".  No numbers.  Aim of this
reproduction: with today's controllers no contact of solids between the robots deeper than 2 mm in an hour of robot time.

Each robot gets random postures over its whole range at 20 % speed (23 motors of the iCub, 6 of the Katana), the same in all conditions.
The protections are: none; a reflex for each robot, with its own history of poses, both equally fast ("in step") or the Katana's a quarter
as fast ("out of step"); one reflex with one history for both robots; a controller of MoBeE 2.0 for each robot.  A reflex is triggered by a
contact of its robot's solids or fields (larger volumes around the links), a motor beyond a limit, or a violated clause (constraint on
several joints).  Motors have lag, delay, play and encoder noise; a tick is 10 ms; everything runs in one process.  The model computes the
contacts of the true postures; solids do not stop each other.  The iCub's controller has the gains `Gains.default()`.  The Katana's has
`Gains.derived()`, which are for fields that `mobee.derive` computed.  The widths of the fields and the gains were chosen with the results
of seeds 0 to 4 in view; the recorded run has seeds from 100.  A collision is a contact deeper than 2 mm between solids of the two robots.
Run time: for an hour of robot time on one core, three minutes with controllers, and 20 minutes with any other protection.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from typing import Any

from experiments.claims.ch4_reflex.shared_workspace_trial import DEEP, run_trial
from experiments.kit.command_line import positive_number
from experiments.kit.experiment import OUR_AIM, Experiment, Measured, claim, judged
from experiments.kit.plots import draw_points, finish, new_figure
from experiments.kit.rules import is_above
from experiments.kit.statistics import estimate
from experiments.kit.sweep import Cells, Condition, Sweep, grouped

MINUTES, QUICK_MINUTES = 12.0, 0.2  # of robot time, for each seed with controllers
OTHERS = 1 / 3  # of that time, with other protections
SLOWER = 0.25  # pace of the Katana's reflex, out of step
PROTECTIONS: Mapping[str, tuple[str, tuple[float, float]]] = {
    "none": ("none", (1.0, 1.0)),
    "reflexes-out-of-step": ("reflexes", (1.0, SLOWER)),
    "reflexes-in-step": ("reflexes", (1.0, 1.0)),
    "one-reflex": ("one reflex", (1.0, 1.0)),
    "controllers": ("controllers", (1.0, 1.0)),
}

Groups = Mapping[str, Sequence[Mapping[str, Any]]]


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the option --minutes, the robot time of a trial with controllers, to the parser."""
    parser.add_argument(
        "--minutes",
        type=positive_number,
        default=MINUTES,
        metavar="N",
        help="robot time of a trial with controllers, three times that of others (default: %(default)s)",
    )


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the five conditions of the experiment; each one protects the iCub and the Katana from collisions by another method.

    A condition is a name with the settings of `trial`, which runs once for each condition and seed.  The names are the keys of PROTECTIONS.
    "none": no protection.  "reflexes-in-step", "reflexes-out-of-step": each robot has a reflex of MoBeE 1.0, which moves it back along its
    recent poses after a contact; both reflexes are equally fast, or that of the Katana is a quarter as fast.  "one-reflex": one reflex
    moves both robots back.  "controllers": each robot has a controller of MoBeE 2.0.

    `arguments`: the parsed options of the command line.  Runs with controllers last `arguments.minutes` of robot time, or 0.2 minutes if
    `arguments.quick` is True.  Runs with another protection last a third of that time.
    """
    minutes = QUICK_MINUTES if arguments.quick else arguments.minutes
    return [
        Condition(
            name,
            {
                "condition": name,
                "protection": protection,
                "paces": list(paces),
                "minutes": minutes * (1.0 if name == "controllers" else OTHERS),
            },
        )
        for name, (protection, paces) in PROTECTIONS.items()
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Let both robots babble under a protection, and return the times, contacts and counts of reflexes.

    The keys are those of `shared_workspace_trial.run_trial`.  `settings`: the arguments of that function: "protection"; "minutes" of robot
    time; "paces", numbers of recorded poses per tick that the reflexes of iCub and Katana retrace.  `seed`: of postures and encoder noise.
    """
    return run_trial(settings["protection"], settings["minutes"], settings["paces"], seed)


def _total(runs: Sequence[Mapping[str, Any]], name: str) -> float:
    return float(sum(run[name] for run in runs))


def _hourly(runs: Sequence[Mapping[str, Any]]) -> list[float]:
    """Return the collisions of each run per hour of robot time."""
    return [60.0 * run["collisions"] / run["minutes"] for run in runs]


def _safe(runs: Sequence[Mapping[str, Any]]) -> Measured:
    deepest = max(run["deepest"] for run in runs)
    text = f"{_total(runs, 'collisions'):.0f} in {_total(runs, 'minutes'):.0f} minutes of robot time; deepest {1e3 * deepest:.2f} mm"
    return text, bool(deepest <= DEEP)


@claim(
    OUR_AIM,
    "two robots that babble in one workspace for an hour, each with its own controller under one model: contacts of solids between them "
    "deeper than 2 mm",
    "0",
)
def controllers(groups: Groups) -> Measured:
    return _safe(groups["controllers"])


@claim(
    "thesis 4.1.2",
    "two robots that babble in one workspace, each with its own reflex, in step: no collisions of the robots",
    "runs robustly for hours",
    untested="the published poses, speeds and times of the reflexes",
)
def reflexes(groups: Groups) -> Measured:
    return _safe(groups["reflexes-in-step"])


@claim(
    "thesis 4.1.2",
    "the reflexes of two robots must be synchronised: with another pace of one of them the robots collide more often",
    "no number",
    untested="other paces than a quarter, and hardware that differs",
)
def out_of_step(groups: Groups) -> Measured:
    slow, equal = _hourly(groups["reflexes-out-of-step"]), _hourly(groups["reflexes-in-step"])
    return f"collisions per hour: {estimate(slow, 1)}, in step {estimate(equal, 1)}", is_above(slow, equal)


CLAIMS = (controllers, reflexes, out_of_step)


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep as a dict with the keys "protections" and "claims".

    "protections": a dict from the protection to a dict with "minutes" of robot time; the number of "collisions" between the robots;
    "deepest, mm", the depth of the deepest contact of solids between them; "own, mm", the depth of the deepest one of a robot with itself
    or the table; the number of "reflexes", and of those that got "stuck", because no recorded pose was without violation; "rad a minute",
    the path of all motors per minute.  "claims": a list with the judged claims, as dicts (`Claim.record`).
    """
    groups = grouped(found, "condition", tuple(PROTECTIONS))
    rows = {
        name: {
            "minutes": round(_total(runs, "minutes"), 1),
            "collisions": round(_total(runs, "collisions")),
            "deepest, mm": round(1e3 * max(run["deepest"] for run in runs), 2),
            "own, mm": round(1e3 * max(run["deepest_own"] for run in runs), 2),
            "reflexes": round(_total(runs, "reflexes")),
            "stuck": round(_total(runs, "stuck")),
            "rad a minute": round(_total(runs, "path") / _total(runs, "minutes"), 1),
        }
        for name, runs in groups.items()
    }
    return {"protections": rows, "claims": judged(CLAIMS, groups, len(groups) == len(PROTECTIONS))}


def plot(found: Cells) -> Any:
    """Return a figure of the collisions per hour, and of the deepest contact of each run, for each protection."""
    groups = grouped(found, "condition", tuple(PROTECTIONS))
    drawing = new_figure(9.0, 3.4)
    left, right = drawing.subplots(1, 2)
    names = [name.replace("-", " ") for name in groups]
    draw_points(left, names, [_hourly(runs) for runs in groups.values()], fmt="o", color="C0", capsize=3)
    finish(left, ylabel="collisions of the robots an hour", yscale="symlog", ylim=(-0.2, None))
    for number, runs in enumerate(groups.values()):
        right.plot([number] * len(runs), [1e3 * run["deepest"] for run in runs], "o", color="C0", markersize=4)
    right.axhline(1e3 * DEEP, color="C3", linestyle="--", linewidth=1.0, label="aim")
    right.set_xticks(range(len(names)), names)
    top = 2e3 * max(run["deepest"] for runs in groups.values() for run in runs)
    finish(right, legend=8.0, ylabel="deepest contact of a run, mm", yscale="symlog", ylim=(-0.2, max(top, 10.0)))
    for axes in (left, right):
        axes.tick_params(axis="x", labelsize=7, rotation=15)
    return drawing


EXPERIMENT = Experiment(
    claim="two robots that share a model, each with its own controller, babble in one workspace without a collision",
    source=f"thesis 4.1.2; {OUR_AIM}",
    method=Sweep(conditions, trial, findings, plot, seeds=5, add_options=add_options),
    claims=CLAIMS,
)
