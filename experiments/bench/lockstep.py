# SPDX-License-Identifier: Apache-2.0
"""The live system in lockstep, in which ticks wait for all services: its speed with each back-end of the simulated robot.

The back-ends are the motor model ("kinematic"), PyBullet and MuJoCo.

Claim: robot_sim, model, controller and three agents, each in its own process, simulate at least 15 s of robot time per second on the motor
model and 10 s on PyBullet, at ticks of 20 ms, on the standard machine.  Before and after every run the speed of this machine is measured
with helper processes (`Crew.exchanges`), which do a little work for each message and answer it.  Run time: six runs of `seconds` each and
their start.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

from experiments.bench.timing import Calibration, Crew
from experiments.kit.command_line import Progress
from experiments.kit.live.launch import summary_of


@dataclass(frozen=True, slots=True)
class Case:
    """A back-end of the simulated robot and a tick rate, which are measured in one run.

    `backend`: "kinematic", "pybullet" or "mujoco".  `rate`: ticks of the control loop per second [Hz].  `least`: the speed that is
    required; `aim`: the speed that is desired.  Both are in multiples of real time, on the standard machine (the machine for which the
    requirements were set); None: no bound.
    """

    backend: str
    rate: int  # Hz
    least: float | None = None
    aim: float | None = None


HELPERS = 2  # as model and controller: the agents have little to do
CASES = (
    Case("kinematic", 50, 15.0, 26.0),
    Case("pybullet", 50, 10.0, 20.0),
    Case("mujoco", 50),
    Case("kinematic", 100),
    Case("pybullet", 100),
    Case("mujoco", 100),
)


@dataclass(frozen=True, slots=True)
class Settings:
    """Settings of the benchmark.  `seconds`: duration of each run [s].  `cases`: the back-ends and tick rates to run."""

    seconds: float = 20.0
    cases: Sequence[Case] = CASES


def measure(settings: Settings) -> dict[str, Any]:
    """Run the system in each case and return the results; raises LaunchFailed if a system fails or does not end.

    Keys: "seconds", duration of each run [s]; "speed", median speed of this machine in multiples of that of the standard machine (the one
    for which the requirements were set); "runs", a list with the dict that `judged_run` returns for each case; "passed", whether every run
    is repeatable and at least as fast as required.
    """
    runs = []
    with Progress() as progress, Crew(HELPERS) as crew:
        speeds = Calibration(crew.exchanges)
        for done, case in enumerate(settings.cases):
            progress.show(done / len(settings.cases), f"{case.backend} at {case.rate} Hz")
            summary, speed = speeds.around(partial(_run, case, settings.seconds))
            runs.append(judged_run(case, summary, speed))
    return {"seconds": settings.seconds, "speed": speeds.median, "runs": runs, "passed": all(run["passed"] for run in runs)}


def _run(case: Case, seconds: float) -> dict[str, Any]:
    options = (f"services.robot_sim.backend={case.backend}", f"services.robot_sim.rate={case.rate}")
    return summary_of("lockstep", options, duration=seconds)


def judged_run(case: Case, summary: Mapping[str, Any], speed: float) -> dict[str, Any]:
    """Return the numbers of one run and whether it is fast enough and repeatable.

    `summary`: the launcher's summary of the run.  `speed`: speed of this machine in multiples of that of the standard machine (the one for
    which the requirements were set).

    Keys: the fields of `Case`; "speed", in multiples of real time; "standard_speed", the same on the standard machine; "ticks_per_second";
    "ticks" and "transitions" (of all agents), their numbers; "repeatable", whether the summary says that the run can be repeated exactly;
    "passed", whether it is repeatable and has at least the required speed.
    """
    lockstep, agents = summary["lockstep"], summary["agents"]
    standard = lockstep["speed"] / speed
    return {
        **asdict(case),
        "speed": lockstep["speed"],
        "standard_speed": standard,
        "ticks_per_second": lockstep["speed"] * case.rate,
        "ticks": lockstep["ticks"],
        "transitions": sum(agent["transitions"] for agent in agents.values()),
        "repeatable": lockstep["repeatable"],
        "passed": lockstep["repeatable"] and standard >= (case.least or 0.0),
    }


def engine_ratios(runs: Sequence[Mapping[str, Any]]) -> dict[int, float]:
    """Return the speed of MuJoCo over the speed of PyBullet, by tick rate [Hz], for the rates at which both were run.

    `runs`: dicts that `judged_run` returned.
    """
    speeds = {(run["backend"], run["rate"]): run["standard_speed"] for run in runs}
    return {
        rate: speed / speeds["pybullet", rate]
        for (name, rate), speed in speeds.items()
        if name == "mujoco" and ("pybullet", rate) in speeds
    }


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: a table with one line for each run."""
    lines = ["Lockstep of robot_sim, model, controller and three agents, a process each"]
    lines.append(f"{'robot':<10}{'rate':>7}{'x real time':>13}{'ticks/s':>9}{'calibrated':>12}{'at least':>10}{'aim':>5}")
    for run in result["runs"]:
        least, aim = (f"{run[name]:g}" if run[name] else "-" for name in ("least", "aim"))
        verdict = "" if run["passed"] else "  SHORT" if run["repeatable"] else "  VARIES"
        lines.append(
            f"{run['backend']:<10}{run['rate']:>4} Hz{run['speed']:>13.1f}{run['ticks_per_second']:>9.0f}"
            f"{run['standard_speed']:>12.1f}{least:>10}{aim:>5}{verdict}"
        )
    lines += [
        f"MuJoCo is {ratio:.2f} x as fast as PyBullet at {rate} Hz (calibrated)." for rate, ratio in engine_ratios(result["runs"]).items()
    ]
    lines.append(f"calibrated: on the standard machine; processes exchange messages {result['speed']:.2f} x as fast.")
    return "\n".join(lines)
