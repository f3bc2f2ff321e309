"""What the runs say: evaluations of the rivals over those of NES."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench import ik_solvers
from experiments.kit.cells import CellResult
from experiments.kit.claims import Claim
from experiments.kit.statistics import decides, ratio, ratio_interval, told
from mobee.robot.robot import Array

FEW, WHOLE = 10, 41  # motors
NES, XNES = "nes", "xnes"
RIVALS = {
    XNES: ik_solvers.XNES,
    "cma": ik_solvers.CMA_BATCHED,
    "annealing": ik_solvers.ANNEALING,
    "particles": ik_solvers.PARTICLES,
}
THEIRS = {"cma": "CMA-ES", "annealing": "simulated annealing", "particles": "a particle filter"}  # of thesis 3.1.1
OURS = {NES: "NES (the library's)", XNES: "NES (xNES as published)"}
OUTPERFORMS = {
    (ours, theirs): Claim(
        "thesis 3.1.1", f"{OURS[ours]} outperforms {THEIRS[theirs]} at inverse kinematics with 41 motors: fewer evaluations", "no number"
    )
    for ours in OURS
    for theirs in THEIRS
}
CLAIMS = tuple(OUTPERFORMS.values())


@dataclass(frozen=True, slots=True, eq=False)
class Solver:
    """Of one solver and one number of motors: means over the targets of a seed, (seeds,)."""

    reached: Array
    evaluations: Array
    ms: Array

    def __str__(self) -> str:
        return f"{told(self.reached)} reached, {told(self.evaluations, 0)} evaluations, {told(self.ms, 0)} ms"


def solvers(found: Mapping[str, CellResult]) -> dict[tuple[str, int], Solver]:
    """By name and motors, the seeds in their order."""
    runs: dict[tuple[str, int], list[list[float]]] = {}
    for result in sorted(found.values(), key=lambda result: result.cell.seed):
        values, settings = result.values, result.cell.settings
        means = [float(values[key].mean()) for key in ("reached", "evaluations", "ms")]
        runs.setdefault((settings["solver"], settings["motors"]), []).append(means)
    return {key: Solver(*np.array(means).T) for key, means in runs.items()}


def findings(found: Mapping[str, CellResult]) -> dict[str, Any]:
    """A row a solver and number of motors, and the claims."""
    known = solvers(found)
    rows = {f"{name}, {motors} motors": str(solver) for (name, motors), solver in sorted(known.items())}
    return {"solvers": rows, "claims": [claim.record() for claim in judged(known)]}


def judged(known: Mapping[tuple[str, int], Solver]) -> list[Claim]:
    """The claims with our numbers; open where one of the two has not run."""
    return [
        _judged(claim, known[ours, WHOLE], known[theirs, WHOLE]) if {(ours, WHOLE), (theirs, WHOLE)} <= known.keys() else claim
        for (ours, theirs), claim in OUTPERFORMS.items()
    ]


def _judged(claim: Claim, ours: Solver, theirs: Solver) -> Claim:
    low, high = ratio_interval(theirs.evaluations, ours.evaluations)
    text = f"the rival needs {ratio(theirs.evaluations, ours.evaluations):.2f} x [{low:.2f}, {high:.2f}]: NES {ours}; rival {theirs}"
    return claim.measured(text, decides((low, high), least=1.0))
