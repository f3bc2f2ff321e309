# SPDX-License-Identifier: Apache-2.0
"""Figures of processor time over problem size, for model, plant and plans: `mobee bench model|plant|vi --figure FILE`.

The times are those of a pose of the model, of a tick or a second of the offline plant, and of a plan (the solution of an MDP).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench import model, plant, vi
from experiments.bench.peers import QUANTECON
from experiments.bench.scenes import boxes_world, upper_body
from experiments.bench.timing import one_core, rates
from experiments.kit.command_line import Progress
from experiments.kit.plots import new_figure

Curves = dict[str, dict[float, dict[str, float]]]  # {curve: {size: {name: cost}}}

BOXES = (0, 3, 10, 30, 100, 300, 1000)
PRIMITIVES = (8, 16, 32, 64, 96, 129)
BOXES_OF_PRIMITIVES = 100  # around the robot, while the number of primitives changes
MODEL_STYLES = {  # label, colour, line
    model.BATCH: ("ours, in batches", "C0", "-"),
    model.CALL: ("ours, one call a pose", "C0", "--"),
    model.MUJOCO: ("MuJoCo, detection only", "C1", "-"),
    model.TREES: ("python-fcl, trees, yes or no only", "C2", "-"),
}
TICKS = (0.001, 0.002, 0.005, 0.01, 0.02)  # s
OBJECTS = (0, 1, 3, 10, 30, 100, 300, 1000)
STATES = (100, 316, 1000, 3162, 10_000, 31_623, 100_000)
QUICK_STATES = STATES[:5]
DISCOUNTS = (0.5, 0.7, 0.9, 0.95, 0.99, 0.995)
PLAN_STYLES = {  # colour, line
    vi.WARM: ("C0", "--"),
    vi.COLD: ("C0", "-"),
    vi.ALGORITHM_7: ("C2", "-"),
    vi.SCIPY: ("C1", "-"),
    QUANTECON["value_iteration"]: ("C3", "-"),
    QUANTECON["modified_policy_iteration"]: ("C3", "--"),
}


@dataclass(frozen=True, slots=True)
class CostFigure:
    """The functions that measure and draw one figure of costs, and its layout.

    `measure`: function that measures and returns the curves, with the arguments `quick` and `rounds` of `write`.  It returns {curve: {size:
    {name: cost}}}: size is the value on the horizontal axis (as a number of boxes), name is a program or a unit of cost.  `draw`: function
    that draws the curves on two Matplotlib axes, left and right.  `height`: height of the figure, inches.  `share_y`: whether both axes
    have the same y axis.
    """

    measure: Callable[..., Curves]
    draw: Callable[[Any, Any, Curves], None]
    height: float
    share_y: bool

    def write(self, path: Path, quick: bool, rounds: int | None = None) -> Curves:
        """Measure the curves, write the figure to `path`, and return the curves.

        `quick`: fewer repetitions and sizes.  `rounds`: repetitions; None: the default.  Raises MatplotlibMissing before anything is
        measured.
        """
        figure = new_figure(9.0, self.height)
        curves = self.measure(quick, rounds)
        left, right = figure.subplots(1, 2, sharey=self.share_y)
        for axes in (left, right):
            axes.grid(alpha=0.3)
        self.draw(left, right, curves)
        figure.savefig(path, dpi=150)
        return curves


@contextmanager
def _measured(points: list[tuple[str, float]]) -> Iterator[Iterator[tuple[str, float]]]:
    """Yield an iterator over `points`; inside the context this process runs on one core, and the iterator shows the progress.

    A point is the name of a curve and a size at which it is measured.  A context manager.
    """
    with one_core(), Progress() as progress:

        def shown() -> Iterator[tuple[str, float]]:
            for done, (curve, size) in enumerate(points):
                progress.show(done / len(points), f"{size:g} {curve}")
                yield curve, size

        yield shown()


def model_costs(quick: bool, rounds: int | None = None, poses: int = 500) -> Curves:
    """Measure the processor time of evaluating a pose, by our model and by other programs, for several numbers of boxes and of primitives.

    Returns {"boxes" or "primitives": {number: {program: median processor time [us] per pose}}}.  "number" counts the boxes around the
    robot, or the robot's primitives (collision volumes).  `poses`: poses per round.  `rounds`: None for 9, or for 3 if `quick`.  Raises
    NotInstalled without MuJoCo or python-fcl.
    """
    rounds = rounds or (3 if quick else 9)
    curves: Curves = {"boxes": {}, "primitives": {}}
    points: list[tuple[str, float]] = [("boxes", size) for size in BOXES]
    with _measured(points + [("primitives", size) for size in PRIMITIVES]) as sizes:
        for curve, size in sizes:
            primitives, boxes = (129, int(size)) if curve == "boxes" else (int(size), BOXES_OF_PRIMITIVES)
            everyone = model.contestants(upper_body(primitives=primitives), boxes, poses)
            found = rates({name: everyone[name] for name in MODEL_STYLES}, rounds)
            curves[curve][int(size)] = {name: float(np.median(1e6 / values)) for name, values in found.items()}
    return curves


def draw_model_costs(left: Any, right: Any, curves: Mapping[str, Any]) -> None:
    """Draw the curves of `model_costs`: cost of a pose over the number of boxes (left axes) and of primitives (right axes)."""
    titles = {"boxes": "objects around 129 primitives", "primitives": f"primitives among {BOXES_OF_PRIMITIVES} objects"}
    for axes, (curve, title) in zip((left, right), titles.items(), strict=True):
        found = curves[curve]
        for name, (label, color, line) in MODEL_STYLES.items():
            axes.plot(list(found), [one[name] for one in found.values()], line, color=color, marker=".", label=label)
        axes.set_xlabel(title)
        axes.set_yscale("log")
    _counts_axis(left, BOXES)
    right.set_xticks(PRIMITIVES, [str(count) for count in PRIMITIVES])
    left.set_ylabel("processor time a pose [us]")
    left.legend(fontsize="small", loc="upper left", bbox_to_anchor=(0.02, 0.88))  # between the curves of the peers


def _counts_axis(axes: Any, counts: tuple[int, ...]) -> None:
    """Set a logarithmic axis for counts from 0 to 1000."""
    axes.set_xscale("symlog", linthresh=3)
    axes.set_xlim(-0.5, 1400)
    axes.minorticks_off()
    axes.set_xticks(counts, [str(count) for count in counts])


def plant_costs(quick: bool, rounds: int | None = None) -> Curves:
    """Measure the processor time of a plant with one arm, for several lengths of the tick [s] and numbers of objects.

    Returns {"tick" or "objects": {size: {"us_per_tick": ..., "ms_per_second": ...}}}.  "us_per_tick": processor time of a tick [us].
    "ms_per_second": processor time for one second of the plant's time [ms].  `quick`: fewer actions.  `rounds` is not used.
    """
    curves: Curves = {"tick": {}, "objects": {}}
    points: list[tuple[str, float]] = [("tick", dt) for dt in TICKS]
    with _measured(points + [("objects", count) for count in OBJECTS]) as sizes:
        for curve, size in sizes:
            dt, objects = (size, 0) if curve == "tick" else (plant.DT, int(size))
            found = plant.one_arm(plant.arm_plant(dt, boxes_world(objects)), 10 if quick else 100).numbers
            curves[curve][size] = {"us_per_tick": found["us_per_tick"], "ms_per_second": 1e3 / found["times_real_time"]}
    return curves


def draw_plant_costs(left: Any, right: Any, curves: Mapping[str, Any]) -> None:
    """Draw the curves of `plant_costs`: cost over the length of the tick (left axes) and over the number of objects (right axes)."""
    ticks, objects = curves["tick"], curves["objects"]
    left.plot([1e3 * dt for dt in ticks], [one["ms_per_second"] for one in ticks.values()], "C0.-")
    left.set_xlabel("control tick [ms]")
    left.set_ylabel("processor time a second of plant time [ms]")
    left.set_xscale("log")
    left.set_yscale("log")
    left.minorticks_off()
    left.set_xticks([1e3 * dt for dt in ticks], [f"{1e3 * dt:g}" for dt in ticks])
    right.plot(list(objects), [one["us_per_tick"] for one in objects.values()], "C0.-")
    right.set_xlabel(f"objects around, ticks of {1e3 * plant.DT:g} ms")
    right.set_ylabel("processor time a tick [us]")
    _counts_axis(right, tuple(objects))
    right.set_ylim(0.0, None)
    left.set_title("one arm, nothing around", fontsize="medium")
    right.set_title("one arm", fontsize="medium")


def plan_costs(quick: bool, rounds: int | None = None) -> Curves:
    """Measure the processor time of solving an MDP (a plan) with each solver, for several numbers of states and several discount factors.

    Returns {"states" or "discount": {size: {solver: median processor time [us] per plan}}}.  `quick`: only up to 10 000 states.  `rounds`
    is not used.  Raises NotInstalled without quantecon.
    """
    curves: Curves = {"states": {}, "discount": {}}
    known = vi.after_transitions(1000, 50)
    points: list[tuple[str, float]] = [("discount", at) for at in DISCOUNTS]
    with _measured(points + [("states", at) for at in (QUICK_STATES if quick else STATES)]) as sizes:
        for curve, size in sizes:
            states = int(size) if curve == "states" else 0
            problem, discount = (vi.problem_of_size(states), vi.DISCOUNT) if states else (known, size)
            solvers = vi.contestants(problem, discount, repeats=max(1, 2000 // max(states, 100)))
            found = rates({name: solvers[name] for name in (*PLAN_STYLES, vi.MODEL_CHANGES)}, 3 if states <= 10_000 else 1)
            costs = {name: float(np.median(1e6 / values)) for name, values in found.items()}
            costs[vi.WARM] -= costs.pop(vi.MODEL_CHANGES)
            curves[curve][states or size] = costs
    return curves


def draw_plan_costs(left: Any, right: Any, curves: Mapping[str, Any]) -> None:
    """Draw the curves of `plan_costs`: cost over the number of states (left axes) and over 1 / (1 - discount) (right axes)."""
    horizon = {1.0 / (1.0 - at): one for at, one in curves["discount"].items()}
    for axes, found in ((left, curves["states"]), (right, horizon)):
        for name, (color, line) in PLAN_STYLES.items():
            axes.plot(list(found), [1e-3 * one[name] for one in found.values()], line, color=color, marker=".", label=name)
        axes.set_xscale("log")
        axes.set_yscale("log")
    left.set_xlabel(f"states, 16 actions each, discount {vi.DISCOUNT}")
    right.set_xlabel("1 / (1 - discount), 81 states, 16 actions each")
    right.minorticks_off()
    right.set_xticks(list(horizon), [f"{at:.3g}" for at in horizon])
    left.set_ylabel("processor time a plan [ms]")
    right.legend(fontsize="small", loc="upper left")


FIGURES = {
    "model": CostFigure(model_costs, draw_model_costs, height=3.8, share_y=True),
    "plant": CostFigure(plant_costs, draw_plant_costs, height=3.8, share_y=False),
    "vi": CostFigure(plan_costs, draw_plan_costs, height=4.0, share_y=True),
}
