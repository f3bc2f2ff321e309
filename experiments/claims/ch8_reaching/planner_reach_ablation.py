# SPDX-License-Identifier: Apache-2.0
"""Compare the coarse planner alone, the reactive reach alone, and both together.

Claim: a coarse discrete planner together with a reactive reach achieves more than either alone.  The planner needs few states, because the
reach covers the remaining distance; only together do they bring the hand to the targets from arbitrary poses, also from behind a target.
Source: thesis 5.3, 8.2, 9.3.  Published: no numbers.  Run time: three minutes on 2 cores.

Robots: the right arm of 2014 under the published control law, and today's right arm under the default law.  There are 27 targets that the
palm can touch, 19 of the thesis and 8 drawn between them.  Each case begins in a random pose, which is neither home nor a lattice state.

Methods.  "planner": the MDP plans to the state in which the palm is nearest to the target, and stops there.  "reach": a force pulls the
palm to the target from the first pose.  "both": a learner that has made 3000 transitions as a curious agent, and 800 tries to reach without
obstacles, plans to the state with the highest expected reward of a reach, and reaches from there; it learns nothing from these cases.  Both
planners ("planner" and "both") use the learned outcomes of transitions, know which transitions a target blocks, as was learned, and
remember within a case which transitions failed.  Under the default law up to three reaches are made per case until one does not miss:
"both" first plans to another state, "reach" repeats in place.

Scenes: free space; the hand behind the target, as seen from the shoulder; the arm within 3 cm of the target, with the palm turned away; a
ball of 8 cm between hand and target, which only MoBeE's model contains; a target that moves 5 to 12 cm at 3 cm/s.

Under the default law the measure is success: the palm within 2 cm of the target's surface when the force ends.  Under the published law,
whose reaches aim at the target's centre, it is the reward of eq. 8.4, as in the thesis.  Targets, poses and noise depend on the seed.
Seed 0 was used while the scenes were developed: the reported runs begin with --seed 1.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from functools import partial
from itertools import product
from typing import Any

import numpy as np

from experiments.kit.experiment import OUR_AIM, Claim, Envelope, Experiment, Measured, judged
from experiments.kit.plots import draw_bars, new_figure
from experiments.kit.reaching.arm import TRANSITIONS
from experiments.kit.reaching.cases import METHODS, SCENES, attempt, make_cases, trained
from experiments.kit.reaching.targets import GOOD
from experiments.kit.rules import rises
from experiments.kit.statistics import estimate
from experiments.kit.sweep import Cells, Condition, Sweep, grouped
from mobee.arrays import Array
from mobee.errors import InvalidValue

TRIES, CASES = 800, 40
LAWS = ("published", "default")
MEASURE = {"published": "reward", "default": "success"}
"""The measure that is compared under each control law: the reward of the thesis (eq. 8.4), or the share of successes."""
SOURCES = {"published": "thesis 5.3, 8.2, 9.3", "default": f"thesis 5.3, 8.2, 9.3; {OUR_AIM}, with its own law"}
SITUATIONS = {
    "free": "from arbitrary poses to targets in free space",
    "around": "with the hand behind the target",
    "against": "with the hand against the object",
    "between": "past an obstacle between hand and target",
    "moving": "to a target that moves",
}
MORE = {"reward": "earn more reward", "success": "more often bring the palm within 2 cm of the target"}
COLORS = {"planner": "tab:blue", "reach": "tab:orange", "both": "tab:red"}
LABELS = {"planner": "planner alone", "reach": "reach alone", "both": "both"}
TITLES = {
    "free": "in free space",
    "around": "hand behind\nthe target",
    "against": "hand against\nthe object",
    "between": "obstacle\nbetween",
    "moving": "target moves",
}
AXIS_LABELS = {"success": "share of cases with the palm within 2 cm", "reward": "mean reward (eq. 8.4)"}

Groups = Mapping[str, list[dict[str, Any]]]  # law -> values by seed


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the settings of the runs: one for each control law; its trial trains a learner, and tries all scenes.

    With --quick there are fewer transitions, tries and cases.
    """
    full = {"transitions": TRANSITIONS, "tries": TRIES, "cases": CASES}
    settings = {"transitions": 500, "tries": 50, "cases": 4} if arguments.quick else full
    return [Condition(law, settings | {"law": law}) for law in LAWS]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Train a learner, and attempt the same cases of each scene with each method, "planner", "reach" and "both".

    Returns arrays (cases,) with keys "scene|method|measure".  The measures are "missing", the distance of the palm from the target's
    surface [m]; "seconds", plant time; and "reward" (thesis eq. 8.4).  `settings`: "law", one of LAWS; "transitions" and "tries", numbers
    of the training; "cases", their number.  `seed`: of learner and cases.
    """
    law = settings["law"]
    agent = trained(seed, settings["transitions"], settings["tries"], law)
    found: dict[str, Any] = {}
    for scene in SCENES:
        cases = make_cases(scene, settings["cases"], seed, law)
        for method in METHODS:
            made = [attempt(method, agent, case, 1000 * seed + number, law=law) for number, case in enumerate(cases)]
            for measure in ("missing", "seconds", "reward"):
                found[f"{scene}|{method}|{measure}"] = np.array([getattr(one, measure) for one in made])
    return found


def findings(found: Cells) -> dict[str, Any]:
    """Return the results: "claims" is a list with the judged claims, as dicts, "cases" a list with a row for each law, scene and method.

    The values of a row, a dict, are text: "law", "scene", "method", "success", "reward", "median distance left [cm]", "robot time [s]".
    """
    groups = grouped(found, "law", LAWS)
    rows = []
    for law, scene, method in product(groups, SCENES, METHODS):
        row = {measure: estimate(means(groups, law, scene, method, measure)) for measure in ("success", "reward")}
        error = estimate([100.0 * float(np.median(values[f"{scene}|{method}|missing"])) for values in groups[law]], 1)
        seconds = estimate(means(groups, law, scene, method, "seconds"), 1)
        rows.append({"law": law, "scene": scene, "method": method, **row, "median distance left [cm]": error, "robot time [s]": seconds})
    return {"claims": judged(CLAIMS, groups), "cases": rows}


def means(groups: Groups, law: str, scene: str, method: str, measure: str) -> Array:
    """Return the mean of a measure over the cases, for each seed, (seeds,).

    `groups`: results of `trial` by law.  `law`, `scene`, `method`: which runs and cases are used.  `measure`: "missing", distance of the
    palm from the target's surface [m]; "seconds", plant time; "reward" (thesis eq. 8.4); or "success", the share of cases with the palm
    within 2 cm of the target's surface.
    """
    name = "missing" if measure == "success" else measure
    each = [values[f"{scene}|{method}|{name}"] for values in groups[law]]
    return np.array([(values <= GOOD if measure == "success" else values).mean() for values in each])


def _together(law: str, groups: Groups) -> Measured:
    """Judge whether planner and reach together achieve more than the reach alone, for each scene.

    The planner alone is not compared, because it does not reach for the target.  `law`: the control law of the runs.  Returns a text with
    the means of both methods, and the verdict for each scene.
    """
    if law not in groups:
        return "not measured", None
    pairs = {scene: [means(groups, law, scene, method, MEASURE[law]) for method in ("reach", "both")] for scene in SCENES}
    each = (f"{SITUATIONS[scene]}: reach alone {estimate(alone)}, both {estimate(both)}" for scene, (alone, both) in pairs.items())
    found = {SITUATIONS[scene]: rises(both - alone) for scene, (alone, both) in pairs.items()}
    return f"{MEASURE[law]}; {'; '.join(each)}", Envelope("situation", found)


CLAIMS = tuple(
    Claim(
        SOURCES[law],
        f"coarse planner and reactive reach together {MORE[MEASURE[law]]} than the reach alone, in five situations ({law} law)",
        "no number",
        rule=partial(_together, law),
    )
    for law in LAWS
)


def plot(found: Cells) -> Any:
    """Draw a bar with its interval for each scene and method, a panel for each law.

    The bars are mean rewards (thesis eq. 8.4) under the published law, and shares of successes under the default law.  Returns a matplotlib
    figure.  Raises InvalidValue if a law has no finished run.
    """
    groups = grouped(found, "law", LAWS)
    if len(groups) < len(LAWS):
        raise InvalidValue("some cells are not finished: continue the run with --resume.")
    drawing = new_figure(14.0, 4.4)
    for axes, law in zip(drawing.subplots(1, len(LAWS)), LAWS, strict=True):
        for number, method in enumerate(METHODS):
            values = [means(groups, law, scene, method, MEASURE[law]) for scene in SCENES]
            draw_bars(axes, np.arange(len(SCENES)) + 0.26 * (number - 1), values, 0.24, COLORS[method], LABELS[method])
        axes.set_xticks(range(len(SCENES)), [TITLES[scene] for scene in SCENES])
        axes.set(title=f"{law} law", ylabel=AXIS_LABELS[MEASURE[law]], ylim=(0.0, None))
        axes.grid(alpha=0.2, axis="y")
    drawing.axes[0].legend(fontsize=9)
    return drawing


EXPERIMENT = Experiment(
    claim="a coarse planner together with a reactive reach achieves more than either alone",
    source="thesis 5.3, 8.2, 9.3",
    method=Sweep(conditions, trial, findings, plot),
    claims=CLAIMS,
)
