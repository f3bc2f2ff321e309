# SPDX-License-Identifier: Apache-2.0
"""NGIK (natural gradient inverse kinematics): number of evaluations of the model, compared with other optimisers.

Claim: NES outperforms the other optimisation approaches at solving inverse kinematics for the iCub's 41 motors.  Source: thesis 3.1.1.
Published: no numbers.  Run time: 3 minutes on 2 cores.

The targets are poses (position and rotation) of the right palm in random postures among 100 boxes; a solution is within 5 mm and 5 degrees
and has no contact.  Either all 41 motors may move, or the 10 of torso and arm.  All solvers minimise the same cost.  A solver ends at its
first good pose, restarts by its own criterion if it makes no progress, and stops without success after 20 000 evaluations.  The solvers are
the library's NES (natural evolution strategy), as in `solve_ik(method="nes")`; xNES as published (Glasmachers 2010); CMA-ES (package cma),
which evaluates a whole generation in one batch; simulated annealing; and a particle filter.  The evaluations per target are counted, also
for targets that are not reached; "outperforms" means fewer evaluations than the rival.  Each seed has its own targets.  Times are processor
time of one core.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from experiments.bench import ik
from experiments.bench.ik import MAX_EVALUATIONS, MOTORS, Solve, library, rival, scene, targets, timed
from experiments.bench.peers import load_cma
from experiments.kit.experiment import Claim, Envelope, Experiment, Measured, judged
from experiments.kit.plots import finish, new_figure, ticks_at
from experiments.kit.rules import all_hold, decides
from experiments.kit.statistics import estimate, ratio_estimate, ratio_interval
from experiments.kit.sweep import Cells, Condition, Sweep, grouped_by
from mobee import Model
from mobee.arrays import Array

TARGETS, QUICK_TARGETS = 20, 2  # per seed
FEW, WHOLE = 10, 41  # motors
NES, XNES = "nes", "xnes"
RIVALS = {
    XNES: ik.XNES,
    "cma": ik.CMA_BATCHED,
    "annealing": ik.ANNEALING,
    "particles": ik.PARTICLES,
}
THEIRS = {"cma": "CMA-ES", "annealing": "simulated annealing", "particles": "a particle filter"}  # of thesis 3.1.1
OURS = {NES: "the library's", XNES: "xNES as published"}
MIN_SHOWN, TICKS = 100, (100, 300, 1000, 3000, 10_000, MAX_EVALUATIONS)  # evaluations, of the figure


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: every solver with 41 and with 10 motors.  With --quick: two targets per seed."""
    count = QUICK_TARGETS if arguments.quick else TARGETS
    return [
        Condition(f"{name}-{motors}", {"solver": name, "motors": motors, "targets": count}, motors)
        for motors in (WHOLE, FEW)
        for name in (NES, *RIVALS)
    ]


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Solve the inverse kinematics of the targets of this seed, one after another, with the solver and motors that the settings name.

    Returns arrays (targets,): "reached", whether a pose was found; "evaluations", number of evaluations of the model; "ms", processor time.
    `settings`: "solver", its name; "motors", how many motors may move, 41 or 10; "targets", number of targets.
    """
    model, name, count = _model(), settings["solver"], settings["targets"]
    motors = MOTORS if settings["motors"] == FEW else None
    solve: Solve = library(model, "nes", motors) if name == NES else rival(model, RIVALS[name], motors)
    aims, first = targets(model, count, seed), seed * count
    solve(aims[0], first)  # fills caches before the timing
    reached, evaluations, ms = zip(*(timed(solve, aim, number) for number, aim in enumerate(aims, first)), strict=True)
    return {"reached": np.array(reached), "evaluations": np.array(evaluations), "ms": np.array(ms)}


@cache
def _model() -> Model:
    return scene()


@dataclass(frozen=True, slots=True, eq=False)
class Solver:
    """Results of one solver with 41 or 10 moving motors: arrays (seeds,) of means over the targets of each seed.

    `reached`: share of the targets for which a pose was found.  `evaluations`: number of evaluations of the model per target.  `ms`:
    processor time per target.
    """

    reached: Array
    evaluations: Array
    ms: Array

    def __str__(self) -> str:
        return f"{estimate(self.reached)} reached, {estimate(self.evaluations, 0)} evaluations, {estimate(self.ms, 0)} ms"


Solvers = Mapping[tuple[str, int], Solver]  # by solver and number of motors


def solvers(found: Cells) -> Solvers:
    """Return a dict from (solver, number of motors) to the results; their values are in the order of the seeds."""
    groups = grouped_by(found, "solver", "motors")
    columns = ("reached", "evaluations", "ms")
    return {key: Solver(*(np.array([float(run[name].mean()) for run in runs]) for name in columns)) for key, runs in groups.items()}


def findings(found: Cells) -> dict[str, Any]:
    """Return the results of the sweep.

    Keys: "solvers", a dict from "solver, number of motors" to a line of text with the share of the targets that were reached, the number of
    evaluations per target, and the processor time per target [ms]; "claims", a list with the judged claims, as dicts (`Claim.record`).
    """
    known = solvers(found)
    rows = {f"{name}, {motors} motors": str(solver) for (name, motors), solver in sorted(known.items())}
    return {"solvers": rows, "claims": judged(CLAIMS, known)}


def _outperforms(known: Solvers) -> Measured | None:
    """Judge for each of the two NES whether each rival of the thesis needs more evaluations with 41 motors.

    Returns the numbers as text, and for each NES True, False, or None (not decided).  Returns None if a solver has no results.
    """
    if not {(name, WHOLE) for name in (*OURS, *THEIRS)} <= known.keys():
        return None
    parts, found = list[str](), dict[str, bool | None]()
    for ours, name in OURS.items():
        needed = {rival: (known[rival, WHOLE].evaluations, known[ours, WHOLE].evaluations) for rival in THEIRS}
        ratios = (f"{THEIRS[rival]} needs {ratio_estimate(*pair).replace(' ', ' x ', 1)}" for rival, pair in needed.items())
        parts.append(f"{name} {known[ours, WHOLE]}; {', '.join(ratios)}")
        found[name] = all_hold(decides(ratio_interval(*pair), least=1.0) for pair in needed.values())
    return "; ".join(parts), Envelope("NES", found)


CLAIMS = (
    Claim(
        "thesis 3.1.1",
        f"NES outperforms {', '.join(THEIRS.values())} at inverse kinematics with 41 motors: fewer evaluations",
        "no number",
        rule=_outperforms,
    ),
)


def plot(found: Cells) -> Any:
    """Return a figure of the share of targets reached over the number of evaluations, a panel for each number of motors."""
    drawing = new_figure(10.5, 3.6)
    for axes, motors in zip(drawing.subplots(1, 2, sharey=True), (WHOLE, FEW), strict=True):
        for number, (name, label) in enumerate({NES: OURS[NES], **RIVALS}.items()):
            settings = {"solver": name, "motors": motors}
            mine = [result.values for result in found.values() if settings.items() <= result.cell.settings.items()]
            if mine:
                reached = np.concatenate([values["reached"] for values in mine])
                needed = np.sort(np.concatenate([values["evaluations"] for values in mine])[reached])
                shares = np.arange(len(needed) + 1) / len(reached)
                axes.stairs(shares, [MIN_SHOWN, *needed, MAX_EVALUATIONS], baseline=None, color=f"C{number}", label=label, linewidth=1.5)
        axes.set(title=f"{motors} motors", xlabel="evaluations", xscale="log", xlim=(MIN_SHOWN, MAX_EVALUATIONS), ylim=(0.0, 1.02))
        finish(axes)
        ticks_at(axes, TICKS, [f"{tick}" for tick in TICKS])
    drawing.axes[0].set_ylabel("targets reached")
    drawing.legend(*drawing.axes[1].get_legend_handles_labels(), loc="outside right upper", fontsize=7)
    return drawing


EXPERIMENT = Experiment(
    claim="NES outperforms the other optimisers at solving inverse kinematics for the iCub's 41 motors",
    source="thesis 3.1.1",
    method=Sweep(conditions, trial, findings, plot, require=load_cma),
    claims=CLAIMS,
)
