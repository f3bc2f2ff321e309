"""Settling time and overshoot against the control period, and the responses of some motors."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from experiments.control.ride import GAINS, PERIOD
from experiments.matplotlib_figure import new_figure
from experiments.settle.responses import Response, model, motor_step, step_ride
from mobee import Gains
from mobee.errors import InvalidValue

COLORS = {"default": "tab:blue", "published_2014": "tab:orange"}
SHOWN = ("torso_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_prosup")


def draw(found: Sequence[Response], path: Path) -> Path:
    """Three panels; raises InvalidValue if there is nothing to draw."""
    if not found:
        raise InvalidValue(f"{path.parent} has no responses: it was stopped before the first.")
    drawing = new_figure(13.0, 4.2)
    time, overshoot, steps = drawing.subplots(1, 3)
    for gains in GAINS:
        mine = [r for r in found if r.gains == gains]
        for kind, marker in (("motors", "o"), ("postures", "s")):
            some = [r for r in mine if r.is_posture == (kind == "postures")]
            periods = sorted({r.period_ms for r in some})
            for axes, of in ((time, lambda r: r.settling), (overshoot, lambda r: 100.0 * r.overshoot)):
                values = [[of(r) for r in some if r.period_ms == period] for period in periods]
                low, middle, high = (np.array([f(v) for v in values]) for f in (np.min, np.median, np.max))
                shift = 1.04 if kind == "postures" else 0.96
                axes.errorbar(
                    np.array(periods) * shift, middle, [middle - low, high - middle],
                    color=COLORS[gains], marker=marker, markersize=4.0, capsize=2.0, linestyle="-" if kind == "motors" else ":",
                    label=f"{gains}, {'each motor alone' if kind == 'motors' else 'torso and arms'}",
                )  # fmt: skip
    for axes, label in ((time, "settling time to 5 % [s]"), (overshoot, "overshoot [% of the step]")):
        axes.set(xlabel="control period [ms]", ylabel=label, xscale="log", ylim=(0.0, None), title="median, least and most")
        axes.set_xticks(ticks := sorted({r.period_ms for r in found}), [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
    time.legend(fontsize=7)
    for gains in GAINS:
        numbers = Gains.named(gains)
        for i, motor in enumerate(SHOWN):
            start, end = motor_step(model().robot.motors.index(motor))
            done = step_ride(numbers, 1e3 * PERIOD[gains], start, end, seed=i)
            joint = model().robot.motors.index(motor)
            share = (done.q[:, joint] - start[joint]) / (end - start)[joint]
            label = f"{gains}: {', '.join(SHOWN)}" if i == 0 else None
            steps.plot(done.times, share, color=COLORS[gains], alpha=0.5, linewidth=1.0, label=label)
    steps.axhline(1.0, color="0.5", linewidth=0.8)
    steps.set(xlabel="time [s]", ylabel="share of the step", title="Steps of single motors", xlim=(0.0, 5.0))
    steps.legend(fontsize=6, loc="lower right")
    for axes in (time, overshoot, steps):
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=150)
    return path
