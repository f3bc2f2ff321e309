"""Settling time and overshoot against the control period, and the responses of some motors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.control.colors import COLORS
from experiments.control.models import icub
from experiments.control.ride import PERIOD
from experiments.control.steps import motor_step, step_ride
from experiments.kit.plots import new_figure
from experiments.settle.responses import Response
from mobee import Gains
from mobee.errors import InvalidValue

SHOWN = ("torso_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_prosup")
SHARES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # % of a step, marked
ASIDE = {False: 0.96, True: 1.04}  # times its period is where a motor's, and a posture's, mark stands


def draw(found: Sequence[Response], path: Path) -> Path:
    """Three panels; raises InvalidValue if there is nothing to draw."""
    if not found:
        raise InvalidValue(f"{path.parent} has no responses: it was stopped before the first.")
    drawing = new_figure(13.0, 4.2)
    time, overshoot, steps = drawing.subplots(1, 3)
    _against_period(time, found, lambda r: r.settling)
    time.set(ylabel="settling time to 5 % [s]", title="Settling: median, least and most")
    time.legend(fontsize=7)
    _against_period(overshoot, found, lambda r: 100.0 * r.overshoot)
    overshoot.set(ylabel="overshoot [% of the step]", title="Overshoot: median, least and most", yscale="symlog", ylim=(0.0, None))
    overshoot.set_yticks(SHARES, [f"{share:g}" for share in SHARES])
    _single_steps(steps, list(dict.fromkeys(r.gains for r in found)))
    for axes in (time, overshoot, steps):
        axes.grid(alpha=0.2)
    drawing.savefig(path, dpi=150)
    return path


def _against_period(axes: Any, found: Sequence[Response], value: Callable[[Response], float]) -> None:
    periods = sorted({r.period_ms for r in found})
    for gains, is_posture in dict.fromkeys((r.gains, r.is_posture) for r in found):
        mine = [r for r in found if (r.gains, r.is_posture) == (gains, is_posture)]
        at = sorted({r.period_ms for r in mine})
        values = [[value(r) for r in mine if r.period_ms == period] for period in at]
        low, middle, high = (np.array([of(v) for v in values]) for of in (min, np.median, max))
        axes.errorbar(
            np.array(at) * ASIDE[is_posture],
            middle,
            [middle - low, high - middle],
            color=COLORS[gains],
            marker="s" if is_posture else "o",
            markersize=4.0,
            capsize=2.0,
            linestyle=":" if is_posture else "-",
            label=f"{gains}, {'torso and arms' if is_posture else 'each motor alone'}",
        )
    axes.set(xlabel="control period [ms]", xscale="log", xlim=(periods[0] / 1.3, periods[-1] * 1.3), ylim=(0.0, None))
    axes.set_xticks(periods, [f"{period:g}" for period in periods])
    axes.minorticks_off()


def _single_steps(axes: Any, sets: Sequence[str]) -> None:
    for gains in sets:
        for i, motor in enumerate(SHOWN):
            joint = icub().robot.motors.index(motor)
            start, end = motor_step(joint)
            done = step_ride(Gains.named(gains), 1e3 * PERIOD[gains], start, end, seed=i)
            share = (done.q[:, joint] - start[joint]) / (end - start)[joint]
            axes.plot(done.times, share, color=COLORS[gains], alpha=0.5, linewidth=1.0, label=None if i else gains)
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    axes.set(xlabel="time [s]", ylabel="share of the step", title=", ".join(SHOWN), xlim=(0.0, 5.0))
    axes.title.set_fontsize(9)
    axes.legend(fontsize=7, loc="lower right")
