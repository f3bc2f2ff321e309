"""What a plan costs against the number of states and the discount: ours beside SciPy's sparse matrices and quantecon."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.verdicts import one_core, rates
from experiments.bench.vi import ALGORITHM_7, COLD, DISCOUNT, OBSERVING, SCIPY, WARM, contestants
from experiments.bench.vi_peers import QUANTECON
from experiments.bench.vi_workload import at_work, of_size
from experiments.kit.command_line import Progress
from experiments.kit.plots import new_figure

STATES = (100, 316, 1000, 3162, 10_000, 31_623, 100_000)
QUICK_STATES = STATES[:5]
DISCOUNTS = (0.5, 0.7, 0.9, 0.95, 0.99, 0.995)
_STYLES = {
    WARM: ("C0", "--"),
    COLD: ("C0", "-"),
    ALGORITHM_7: ("C2", "-"),
    SCIPY: ("C1", "-"),
    QUANTECON["value_iteration"]: ("C3", "-"),
    QUANTECON["modified_policy_iteration"]: ("C3", "--"),
}


def measure(quick: bool) -> dict[str, Any]:
    """Medians in us a plan: {"states": {S: {name: us}}, "discount": {g: {name: us}}}; raises QuanteconMissing."""
    curves: dict[str, Any] = {"states": {}, "discount": {}}
    known = at_work(1000, 50)
    points: list[tuple[str, float]] = [("discount", at) for at in DISCOUNTS]
    points += [("states", at) for at in (QUICK_STATES if quick else STATES)]
    with one_core(), Progress() as progress:
        for done, (curve, at) in enumerate(points):
            progress.show(done / len(points), f"{curve} {at:g}")
            states = int(at) if curve == "states" else 0
            work, discount = (of_size(states), DISCOUNT) if states else (known, at)
            solvers = contestants(work, discount, repeats=max(1, 2000 // max(states, 100)))
            found = rates({name: solvers[name] for name in (*_STYLES, OBSERVING)}, 3 if states <= 10_000 else 1)
            curves[curve][at] = {name: float(np.median(1e6 / values)) for name, values in found.items()}
            curves[curve][at][WARM] -= curves[curve][at].pop(OBSERVING)
    return curves


def empty_figure() -> Any:
    """A matplotlib Figure to draw into; raises MatplotlibMissing."""
    return new_figure(9.0, 4.0)


def draw(figure: Any, curves: dict[str, Any], path: Path) -> None:
    """Write the figure, two panels."""
    left, right = figure.subplots(1, 2, sharey=True)
    states = {at: one for at, one in curves["states"].items()}
    horizon = {1.0 / (1.0 - at): one for at, one in curves["discount"].items()}
    for axes, found in ((left, states), (right, horizon)):
        for name, (color, line) in _STYLES.items():
            axes.plot(list(found), [1e-3 * one[name] for one in found.values()], line, color=color, marker=".", label=name)
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.grid(alpha=0.3)
    left.set_xlabel(f"states, 16 actions each, discount {DISCOUNT}")
    right.set_xlabel("1 / (1 - discount), 81 states, 16 actions each")
    right.minorticks_off()
    right.set_xticks(list(horizon), [f"{at:.3g}" for at in horizon])
    left.set_ylabel("processor time a plan [ms]")
    right.legend(fontsize="small", loc="upper left")
    figure.savefig(path, dpi=150)
