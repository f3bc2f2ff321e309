# SPDX-License-Identifier: Apache-2.0
"""The live system in real time: jitter of the controller's period, and age of the command that the robot obeys, at several rates.

Claim: on two cores the age is at most 2 ticks in 99 of 100 ticks up to 200 Hz, 3 up to 500 Hz and 5 at 1 kHz.  The age of a command is the
number of ticks between the state from which it was computed and the tick in which the robot obeys it.  Age and jitter are measured by the
services (the processes of the system).  Ticks in which a part holds (brakes and stands still) are counted separately and have no age.
Before and after every run, a chain of processes that only do a little fixed work (`timing.bare_ages`) measures the delay that the
machine's scheduling causes.  If this delay is k times that of the standard machine, the allowed ages are k times larger.  Run time: 30 s
(`seconds`) and a start for every rate, on a machine that does nothing else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from experiments.bench.timing import bare_ages
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import summary_of

MAX_AGE = {200: 2.0, 500: 3.0, 1000: 5.0}  # ticks (p99), up to that rate [Hz]
BARE_AGE = {200: 1.0, 500: 2.0, 1000: 2.0}  # ticks (p99) of the bare chain on the standard machine
BARE_SECONDS = 3.0  # of the bare chain, before and after every run
_COLUMNS = ("rate", "age p50", "p99", "bare", "allowed", "most", "jitter p50", "p99", "missed", "held", "late")


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.

    `rates`: rates of the control loop [Hz].  `seconds`: duration of each run [s].  `backend`: the robot: "kinematic", "pybullet" or
    "mujoco".
    """

    rates: Sequence[int] = (100, 200, 500, 1000)
    seconds: float = 30.0
    backend: str = "kinematic"


def measure(settings: Settings) -> dict[str, Any]:
    """Run the system at each tick rate and return the result; raises LaunchFailed if a system fails or does not end.

    Keys: "backend", of the simulated robot; "seconds", duration of each run [s]; "runs", a list with the dict that `judged_run` returns for
    each rate; "passed", whether the ages of the commands are small enough in all runs.  The age of a command is the number of ticks between
    the state from which it was computed and the tick in which the robot obeys it.
    """
    runs = []
    with Progress() as progress:
        for done, rate in enumerate(settings.rates):
            progress.show(done / len(settings.rates), f"{settings.backend} at {rate} Hz")
            options = (f"services.robot_sim.backend={settings.backend}", f"services.robot_sim.rate={rate}")
            bare = [bare_ages(rate, BARE_SECONDS)]
            summary = summary_of("kinematic", options, duration=settings.seconds)
            bare.append(bare_ages(rate, BARE_SECONDS))
            runs.append(judged_run(rate, summary, float(np.percentile(np.concatenate(bare), 99))))
    return {"backend": settings.backend, "seconds": settings.seconds, "runs": runs, "passed": all(run["passed"] for run in runs)}


def judged_run(rate: int, summary: Mapping[str, Any], bare_p99: float) -> dict[str, Any]:
    """Return the numbers of one run and whether the ages of the commands are small enough.

    The age of a command is the number of ticks from the state from which it was computed to the tick in which the robot obeys it.  `rate`:
    rate of the control loop [Hz].  `summary`: the summary of the run.  `bare_p99`: 99th percentile of the ages [ticks] of a chain of
    processes that do nothing but fixed work (`timing.bare_ages`), measured before and after the run.

    Main keys: "age_p50", "age_p99" and "age_max", ages [ticks]; "jitter_ms_p50" and "jitter_ms_p99", jitter of the controller's period
    [ms]; "at_most", the largest allowed "age_p99", None above 1 kHz; "passed", whether "age_p99" is at most this.
    """
    age, controller = summary["command_age_ticks"], summary["services"]["controller"]
    most = next((ticks * max(1.0, bare_p99 / BARE_AGE[limit]) for limit, ticks in MAX_AGE.items() if rate <= limit), None)
    return {
        "rate": rate,
        "age_p50": age["p50"],
        "age_p99": age["p99"],
        "age_max": age["max"],
        "bare_p99": bare_p99,
        "jitter_ms_p50": controller["jitter_ms_p50"],
        "jitter_ms_p99": controller["jitter_ms_p99"],
        "ticks": summary["ticks"],
        "missed_ticks": summary["missed_ticks"],
        "hold_ticks": summary["hold_ticks"],
        "late_forces": int(controller["late_forces"]),
        "at_most": most,
        "passed": most is None or age["p99"] <= most,
    }


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each rate."""
    lines = [f"Live on the {result['backend']} robot, three agents, {result['seconds']:g} s each; age in ticks, jitter in ms"]
    lines.append("{:>7}{:>8}{:>4}{:>5}{:>8}{:>5}{:>11}{:>7}{:>7}{:>6}{:>6}".format(*_COLUMNS))
    for run in result["runs"]:
        allowed = "-" if run["at_most"] is None else f"{run['at_most']:.3g}"
        lines.append(
            f"{run['rate']:>4} Hz{run['age_p50']:>8.0f}{run['age_p99']:>4.0f}{run['bare_p99']:>5.0f}{allowed:>8}{run['age_max']:>5.0f}"
            f"{run['jitter_ms_p50']:>11.2f}{run['jitter_ms_p99']:>7.2f}{run['missed_ticks']:>7}{run['hold_ticks']:>6}{run['late_forces']:>6}"
            + ("" if run["passed"] else " LATE")
        )
    lines.append("bare: p99 of a chain of processes that only do the calibration's work")
    return "\n".join(lines)
