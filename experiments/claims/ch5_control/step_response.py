# SPDX-License-Identifier: Apache-2.0
"""Step responses: settling time and overshoot, and whether they depend on the control period.

Claim: with the default gains, at all control periods of 1 to 20 ms, single motors reach their targets and stay there within three seconds
(steps of 20 degrees), and whole postures within six seconds (steps of up to half a range), with at most 5 % overshoot.  Source: thesis 5.2
(the dynamical system of eq. 5.7); its figures show no step response.  Published number: an action of an arm took some 9.6 s: three agents
at once made 18 000 actions each in two days (thesis 7.3).  Run time: a few minutes.

Settling time: until the joint stays within 5 % of the step around its end position.  Error: distance of the end position from the attractor
(the posture to which the control law pulls), which is not zero where a limit or a constraint pushes.  The true joint positions are
measured, not the encoders; the motors have lag, delay, play and noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from functools import cache
from typing import Any

import numpy as np

from experiments.kit.command_line import positive_number, positive_whole
from experiments.kit.control.measures import motor_step, postures, run_step, step_response
from experiments.kit.control.plant_runs import COLORS, GAINS, PERIOD, icub
from experiments.kit.experiment import Experiment
from experiments.kit.plots import new_figure
from experiments.kit.run_folder import rounded
from experiments.kit.sweep import Cells, Condition, Sweep
from mobee import Gains
from mobee.arrays import Array
from mobee.errors import UnknownName
from mobee.simulation import OfflinePlant

PERIODS = (1.0, 2.0, 5.0, 10.0, 20.0)  # ms
QUICK_PERIODS = (10.0, 20.0)  # ms
QUICK_MOTORS, QUICK_POSTURES = ("torso_pitch", "l_shoulder_roll", "l_elbow", "l_wrist_prosup"), 2
MAX_OVERSHOOT, MAX_ALONE, MAX_TOGETHER = 0.05, 3.0, 6.0  # of the step; s, a motor and a posture: allowed with the default gains
POSTURE = "posture "  # prefix of the name of a step of many motors

SHOWN = QUICK_MOTORS
SHARES = (0.0, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0)  # % of a step, ticks of the plot
ASIDE = {False: 0.96, True: 1.04}  # factors that separate the marks of motors and postures in the plot


def add_options(parser: argparse.ArgumentParser) -> None:
    """Add the options --gains, --periods, --postures and --motors to the parser."""
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--periods", nargs="+", type=positive_number, default=list(PERIODS), metavar="MS", help="control periods in ms")
    parser.add_argument("--postures", type=positive_whole, default=10, metavar="N", help="steps of torso and arms together (default: 10)")
    parser.add_argument("--motors", nargs="+", metavar="MOTOR", help="that step alone (default: all)")


def conditions(arguments: argparse.Namespace) -> list[Condition]:
    """Return the conditions of the sweep: every gain set, control period and step.

    A step is one of a single motor or of a whole posture; there are no steps of motors that the gain set never moves (weight 0).  Raises
    UnknownName for an unknown motor, and InvalidValue for a period at which the control law is not stable.
    """
    known, periods, chosen, count = icub().robot.motors, arguments.periods, arguments.motors, arguments.postures
    if arguments.quick:
        periods, chosen, count = [p for p in periods if p in QUICK_PERIODS], chosen or QUICK_MOTORS, min(count, QUICK_POSTURES)
    for name in chosen or ():
        if name not in known:
            raise UnknownName("motor", name, known)
    found = []
    for gains in arguments.gains:
        weight = Gains.named(gains).weight(known)
        steps = [motor for i, motor in enumerate(known) if weight[i] and (chosen is None or motor in chosen)]
        steps += [f"{POSTURE}{number}" for number in range(count)]
        for period in periods:
            OfflinePlant(icub(), gains=Gains.named(gains), dt=period / 1e3)  # raises for an unstable period before anything is run
            for step in steps:
                name = f"{gains}-{period:g}-{step.replace(' ', '-')}"
                found.append(Condition(name, {"gains": gains, "period_ms": period, "step": step}, 1.0 / period))
    return found


def trial(settings: dict[str, Any], seed: int) -> dict[str, Any]:
    """Run one step and measure it.  Returns the settings and the measurements as one dict.

    Main keys: "settling", time [s]; "overshoot", as a share of the step; "is_settled"; "error_deg", distance of the end position from the
    attractor (the posture to which the control law pulls).  `settings`: "gains", their name; "period_ms", control period; "step", name of a
    motor, or "posture N" for a step of many motors.  `seed`: of the plant.
    """
    step, gains = settings["step"], Gains.named(settings["gains"])
    if step.startswith(POSTURE):
        number = int(step.removeprefix(POSTURE))
        start, end = _posture_step(settings["gains"], number, seed)
    else:
        number = icub().robot.motors.index(step)
        start, end = motor_step(number)
    measured = step_response(run_step(gains, settings["period_ms"], start, end, seed + number), start, end)
    return rounded(**settings, **asdict(measured))


def _posture_step(gains: str, number: int, seed: int) -> tuple[Array, Array]:
    """Return the start and the goal of a step of many motors, each (n,) rad: two successive postures of a random sequence.

    `number`: index of the goal in the sequence; the step 0 starts at home.  `seed`: of the sequence.  Motors that the gain set never moves
    (weight 0) stay at home.
    """
    home, moving = icub().robot.home, Gains.named(gains).weight(icub().robot.motors) > 0
    before, after = (_posture(n, seed) if n >= 0 else home for n in (number - 1, number))
    return np.where(moving, before, home), np.where(moving, after, home)


@cache
def _posture(number: int, seed: int) -> Array:
    return postures(number + 1, seed)[-1]


def findings(found: Cells) -> dict[str, Any]:
    """Return the results as a dict with a key for each gain set, and the keys "passed" and "each".

    Under a gain set there is a dict from the control period and the kind of step, as "10 ms, motors" or "10 ms, postures", to a dict of
    numbers: the counts "steps" and "never_settled", and for "settling_time_s", "overshoot" (share of the step), "error_deg" (distance of
    the end position from the goal of the step) and "rest_deg" (standard deviation in the last second) a list of the median and the worst
    value.  "each": the text "median and worst".  "passed": whether all steps with the default gains settle, with at most 5 % overshoot,
    within 3 s (single motor) or 6 s (posture); None if the default gains were not run.
    """
    responses = _responses(found)
    table: dict[str, Any] = {}
    for (gains, period, is_posture), mine in responses.items():
        table.setdefault(gains, {})[f"{period:g} ms, {'postures' if is_posture else 'motors'}"] = _summary(mine)
    judged = [_is_good(one, key[2]) for key, mine in responses.items() if key[0] == "default" for one in mine]
    return {"passed": all(judged) if judged else None, "each": "median and worst", **table}


def _is_good(one: Mapping[str, Any], is_posture: bool) -> bool:
    fast = one["settling"] <= (MAX_TOGETHER if is_posture else MAX_ALONE)
    return bool(one["is_settled"] and one["overshoot"] <= MAX_OVERSHOOT and fast)


def _summary(responses: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = {"settling": "settling_time_s", "overshoot": "overshoot", "error_deg": "error_deg", "rest_deg": "rest_deg"}
    summary: dict[str, Any] = {"steps": len(responses), "never_settled": sum(not one["is_settled"] for one in responses)}
    for name, label in names.items():
        values = [one[name] for one in responses]
        summary[label] = [round(float(np.median(values)), 4), round(max(values), 4)]
    return summary


Responses = Mapping[tuple[str, float, bool], list[dict[str, Any]]]  # values by gain set, period [ms], and whether many motors step


def _responses(found: Cells) -> Responses:
    groups: dict[tuple[str, float, bool], list[dict[str, Any]]] = {}
    for values in (result.values for result in found.values()):
        groups.setdefault((values["gains"], values["period_ms"], values["step"].startswith(POSTURE)), []).append(values)
    return dict(sorted(groups.items(), key=lambda item: (GAINS.index(item[0][0]), *item[0][1:])))


def plot(found: Cells) -> Any:
    """Return a figure of settling time and overshoot over the control period, and of the responses of some motors."""
    responses = _responses(found)
    drawing = new_figure(13.0, 4.2)
    time, overshoot, steps = drawing.subplots(1, 3)
    _against_period(time, responses, "settling")
    time.set(ylabel="settling time to 5 % [s]", title="Settling: median, least and most")
    time.legend(fontsize=7)
    _against_period(overshoot, responses, "overshoot", 100.0)
    overshoot.set(ylabel="overshoot [% of the step]", title="Overshoot: median, least and most", yscale="symlog", ylim=(0.0, None))
    overshoot.set_yticks(SHARES, [f"{share:g}" for share in SHARES])
    _single_steps(steps, list(dict.fromkeys(gains for gains, *_ in responses)))
    for axes in (time, overshoot, steps):
        axes.grid(alpha=0.2)
    return drawing


def _against_period(axes: Any, responses: Responses, name: str, factor: float = 1.0) -> None:
    periods = sorted({period for _, period, _ in responses})
    for gains, is_posture in sorted({(gains, is_posture) for gains, _, is_posture in responses}):
        groups = {period: responses[gains, period, is_posture] for period in periods if (gains, period, is_posture) in responses}
        at, values = list(groups), [[factor * one[name] for one in mine] for mine in groups.values()]
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
            run = run_step(Gains.named(gains), 1e3 * PERIOD[gains], start, end, seed=i)
            share = (run.q[:, joint] - start[joint]) / (end - start)[joint]
            axes.plot(run.times, share, color=COLORS[gains], alpha=0.5, linewidth=1.0, label=None if i else gains)
    axes.axhline(1.0, color="0.5", linewidth=0.8)
    axes.set(xlabel="time [s]", ylabel="share of the step", title=", ".join(SHOWN), xlim=(0.0, 5.0))
    axes.title.set_fontsize(9)
    axes.legend(fontsize=7, loc="lower right")


EXPERIMENT = Experiment(
    claim="single motors and whole postures settle in seconds without overshoot, at all control periods of 1 to 20 ms",
    source="thesis 5.2, eq. 5.7",
    method=Sweep(conditions, trial, findings, plot, seeds=1, add_options=add_options),
)
