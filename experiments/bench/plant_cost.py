"""What the offline plant costs against the length of the tick and the number of objects around."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from experiments.bench import workload
from experiments.bench.plant_workload import DT, arm_plant, one_arm
from experiments.bench.verdicts import one_core
from experiments.kit.command_line import Progress
from experiments.kit.plots import new_figure

TICKS = (0.001, 0.002, 0.005, 0.01, 0.02)  # s
OBJECTS = (0, 1, 3, 10, 30, 100, 300, 1000)


def measure(actions: int) -> dict[str, Any]:
    """Processor time {"tick": {dt: ...}, "objects": {N: ...}} of one arm: us a tick, and ms a second of plant time."""
    curves: dict[str, Any] = {"tick": {}, "objects": {}}
    points = [("tick", dt, dt, 0) for dt in TICKS] + [("objects", count, DT, count) for count in OBJECTS]
    with one_core(), Progress() as progress:
        for done, (curve, at, dt, objects) in enumerate(points):
            progress.show(done / len(points), f"{at} {curve}")
            found = one_arm(arm_plant(dt, workload.world(objects)), actions).numbers
            curves[curve][at] = {"us_per_tick": found["us_per_tick"], "ms_per_second": 1e3 / found["times_real_time"]}
    return curves


def empty_figure() -> Any:
    """A matplotlib Figure to draw into; raises MatplotlibMissing."""
    return new_figure(9.0, 3.8)


def draw(figure: Any, curves: dict[str, Any], path: Path) -> None:
    """Write the figure, two panels."""
    left, right = figure.subplots(1, 2)
    ticks, objects = curves["tick"], curves["objects"]
    left.plot([1e3 * dt for dt in ticks], [one["ms_per_second"] for one in ticks.values()], "C0.-")
    left.set_xlabel("control tick [ms]")
    left.set_ylabel("processor time a second of plant time [ms]")
    left.set_xscale("log")
    left.set_yscale("log")
    left.minorticks_off()
    left.set_xticks([1e3 * dt for dt in ticks], [f"{1e3 * dt:g}" for dt in ticks])
    right.plot(list(objects), [one["us_per_tick"] for one in objects.values()], "C0.-")
    right.set_xlabel(f"objects around, ticks of {1e3 * DT:g} ms")
    right.set_ylabel("processor time a tick [us]")
    right.set_xscale("symlog", linthresh=3)
    right.set_xlim(-0.5, 1400)
    right.set_ylim(0.0, None)
    right.minorticks_off()
    right.set_xticks(list(objects), [str(count) for count in objects])
    for axes in (left, right):
        axes.grid(alpha=0.3)
    left.set_title("one arm, nothing around", fontsize="medium")
    right.set_title("one arm", fontsize="medium")
    figure.savefig(path, dpi=150)
