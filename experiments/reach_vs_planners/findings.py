"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.reaching.targets import GOOD
from experiments.kit.statistics import decides, interquartile_mean, interval, told
from mobee.robot.robot import Array

SCENES = ("perfect", "noise", "moving")
WHO = ("learner", "peer")
TOLD = {"perfect": "a perfect model", "noise": "encoder noise five times the usual", "moving": "a target that never rests"}
PEER = dict.fromkeys(SCENES, "inverse kinematics and RRT-Connect") | {
    "moving": "inverse kinematics and RRT-Connect, each of whose motions aims where the target was when it began"
}
EVEN = 0.05  # of success: as much below still counts as equal
FEASIBLE, SMOOTHED = 10.0, 125.0  # s, published
SLOW = 0.1  # of the published times: a planner that takes as much is too slow
CLAIMS = (
    *(
        Claim(
            "thesis 9.3; aim of this reproduction",
            f"with {TOLD[scene]} the learned reacher is no worse than {PEER[scene]} (at most {100.0 * EVEN:.0f} points of success below)",
            "-",
        )
        for scene in SCENES
    ),
    Claim(
        "thesis 1.5",
        "single query planning is too slow to be used online: both arms (12 DOF) around a table's edge to a cup take it at least "
        f"{SLOW * FEASIBLE:.0f} s, a tenth of the published time",
        f"{FEASIBLE:.0f} s",
    ),
    Claim(
        "thesis 1.5",
        f"and smoothing its circuitous way at least {SLOW * SMOOTHED:.1f} s more, a tenth of the published time",
        f"another {SMOOTHED:.0f} s",
    ),
)


def of_cases(done: Mapping[str, CellResult], scene: str, who: str, measure: str) -> Array:
    """The mean over the cases of each seed, (seeds,)."""
    found = sorted((one for one in done.values() if one.cell.settings["scene"] == "cases"), key=lambda one: one.cell.seed)
    return np.array([one.values[f"{scene}|{who}|{measure}"].mean() for one in found])


def of_queries(done: Mapping[str, CellResult], measure: str) -> Array:
    """The median over the queries of each seed, of both arms, (seeds,); but for the planning times, of those with a way alone."""
    ordered = sorted((one for one in done.values() if one.cell.settings["scene"] == "two arms"), key=lambda one: one.cell.seed)
    counted = [one.values[measure][slice(None) if measure == "seconds" else one.values["found"].astype(bool)] for one in ordered]
    return np.array([float(np.median(values)) for values in counted if len(values)])


def claims(done: Mapping[str, CellResult]) -> list[Claim]:
    """The claims with our numbers."""
    found = []
    for scene, claim in zip(SCENES, CLAIMS[:3], strict=True):
        learner, peer = (of_cases(done, scene, who, "success") for who in WHO)
        times = [f"{1000.0 * interquartile_mean(of_cases(done, scene, who, 'thinking')):.1f} ms" for who in WHO]
        text = f"success {told(learner)}, peer {told(peer)}; planning a try {times[0]}, peer {times[1]}"
        found.append(claim.measured(text, decides(interval(learner - peer), least=-EVEN)))
    share = np.array([one.values["found"].mean() for one in done.values() if one.cell.settings["scene"] == "two arms"])
    for claim, measure, published in ((CLAIMS[3], "seconds", FEASIBLE), (CLAIMS[4], "smoothing", SMOOTHED)):
        took = of_queries(done, measure)
        if not len(took):
            found.append(claim.measured("no way was found", None))
            continue
        text = f"{told(took, 3)} s of processor time with a compiled test of poses; a way is found in {told(share)} of the queries"
        found.append(claim.measured(text, decides(interval(took), least=SLOW * published)))
    return found


def summary(done: Mapping[str, CellResult]) -> dict[str, Any]:
    """The tables of the results, as text."""
    rows = [
        {
            "scene": scene,
            "who": who,
            "success": told(of_cases(done, scene, who, "success")),
            "seconds": told(of_cases(done, scene, who, "seconds"), 1),
            "planning [ms]": told(1000.0 * of_cases(done, scene, who, "thinking"), 1),
        }
        for scene in SCENES
        for who in WHO
    ]
    measures = ("seconds", "smoothing", "corners", "missing")
    arms = {measure: of_queries(done, measure) for measure in measures}
    return {
        "cases": rows,
        "both arms": {name: told(values, 3) if len(values) else None for name, values in arms.items()},
        "within [m]": GOOD,
    }
