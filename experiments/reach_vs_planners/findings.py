"""What came of the cells, in numbers with intervals, and what that says of the claims."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from experiments.claims import Claim
from experiments.reaching.arm import GOOD
from experiments.statistics import decides, interquartile_mean, interval, told
from experiments.sweep import CellResult
from mobee.robot.robot import Array

SCENES = ("perfect", "noise", "moving")
WHO = ("learner", "peer")
TOLD = {"perfect": "a perfect model", "noise": "encoder noise five times the usual", "moving": "a target that never rests"}
EVEN = 0.05  # of success: as much below still counts as equal
FEASIBLE, SMOOTHED = 10.0, 125.0  # s, published
CLAIMS = (
    *(
        Claim(
            "thesis 9.3; aim of this reproduction",
            f"with {what} the learned reacher is no worse than inverse kinematics and RRT-Connect",
            "-",
        )
        for what in TOLD.values()
    ),
    Claim("thesis 1.5", "single query planning is too slow to be used online: both arms (12 DOF) around a table's edge to a cup", "10 s"),
    Claim("thesis 1.5", "and its way is circuitous and has to be smoothed", "another 125 s"),
)


def of_cases(done: Mapping[str, CellResult], scene: str, who: str, measure: str) -> Array:
    """The mean over the cases of each seed, (seeds,)."""
    found = sorted((one for one in done.values() if one.cell.settings["scene"] == "cases"), key=lambda one: one.cell.seed)
    return np.array([one.values[f"{scene}|{who}|{measure}"].mean() for one in found])


def of_queries(done: Mapping[str, CellResult], measure: str) -> Array:
    """The median over the queries of each seed, of both arms, (seeds,)."""
    found = sorted((one for one in done.values() if one.cell.settings["scene"] == "two arms"), key=lambda one: one.cell.seed)
    return np.array([float(np.median(one.values[measure])) for one in found])


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
        text = f"{told(took, 3)} s with a compiled test of poses; a way is found in {told(share)} of the queries"
        found.append(claim.measured(text, decides(interval(took), least=published / 10.0)))
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
    return {"cases": rows, "both arms": {measure: told(of_queries(done, measure), 3) for measure in measures}, "within [m]": GOOD}
