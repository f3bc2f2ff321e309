"""How much faster than real time the live processes run in lockstep, on the motor model alone and on PyBullet.

Claim: robot_sim, model, controller and three agents, each a process, make at least 15 s of robot time a second on the motor model
and 7 on PyBullet, at ticks of 20 ms.  Run time: four runs of `seconds` each and their start.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from experiments.launched import summary_of
from experiments.progress import Progress


@dataclass(frozen=True, slots=True)
class Case:
    """One run; `least` and `aim` in multiples of real time."""

    backend: str
    rate: int  # Hz
    least: float | None = None
    aim: float | None = None


CASES = (Case("kinematic", 50, 15.0, 20.0), Case("pybullet", 50, 7.0, 10.0), Case("kinematic", 100), Case("pybullet", 100))


def measure(seconds: float, cases: tuple[Case, ...] = CASES) -> dict[str, Any]:
    """Everything that `mobee bench lockstep --json` prints; raises LaunchFailed."""
    runs = []
    with Progress() as progress:
        for done, case in enumerate(cases):
            progress.show(done / len(cases), f"{case.backend} at {case.rate} Hz")
            runs.append(_measured(case, seconds))
    return {"seconds": seconds, "runs": runs, "passed": all(run["passed"] for run in runs)}


def _measured(case: Case, seconds: float) -> dict[str, Any]:
    settings = (f"services.robot_sim.backend={case.backend}", f"services.robot_sim.rate={case.rate}")
    summary = summary_of("lockstep", settings, duration=seconds)
    lockstep, agents = summary["lockstep"], summary["agents"]
    return {
        **asdict(case),
        "speed": lockstep["speed"],
        "ticks_per_second": lockstep["speed"] * case.rate,
        "ticks": lockstep["ticks"],
        "transitions": sum(agent["transitions"] for agent in agents.values()),
        "repeatable": lockstep["repeatable"],
        "passed": lockstep["repeatable"] and lockstep["speed"] >= (case.least or 0.0),
    }


def report(result: dict[str, Any]) -> str:
    """The same for people."""
    lines = ["Lockstep of robot_sim, model, controller and three agents, a process each"]
    lines.append(f"{'robot':<12}{'rate':>8}{'x real time':>14}{'ticks/s':>10}{'at least':>10}{'aim':>6}")
    for run in result["runs"]:
        least, aim = (f"{run[name]:g}" if run[name] else "-" for name in ("least", "aim"))
        verdict = "" if run["passed"] else "  SHORT" if run["repeatable"] else "  SPOILT"
        lines.append(
            f"{run['backend']:<12}{run['rate']:>5} Hz{run['speed']:>14.1f}{run['ticks_per_second']:>10.0f}{least:>10}{aim:>6}{verdict}"
        )
    return "\n".join(lines)
