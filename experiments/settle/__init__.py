"""Step responses: how long does a motion take, does it overshoot, and does that depend on the control period?

Claim: at control periods of 1 to 20 ms alike, every motor alone and whole postures go where they are sent and stay there, with the
default gains in three and six seconds at most (steps of 20 degrees alone, of up to half a range together), without overshoot worth
the name.  Source: thesis 5.2 (the dynamical system of eq. 5.7); its figures show no step response.  Published number: an action of
an arm took some 9.6 s, 18 000 in two days, three agents at once (thesis 7.3).
Run time: a few minutes.

Settling time: until the joint stays within 5 % of the step around where it comes to rest.  Error: how far that is from the attractor, as
it must be where a limit or a constraint pushes.  The joints are looked at, not the encoders; the motors have lag, delay, play and noise.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.control.models import icub
from experiments.control.ride import GAINS
from experiments.control.steps import postures
from experiments.kit.options import positive_number, positive_whole
from experiments.kit.progress import Progress
from experiments.kit.records import Records, read_records
from experiments.settle.figure import draw
from experiments.settle.responses import Response, responses
from mobee.errors import UnknownName

NAME = "settle"
CLAIM = "motors alone and whole postures settle in seconds without overshoot, alike at control periods of 1 to 20 ms"
SOURCE = "thesis 5.2, eq. 5.7"

RECORDS = "settle.csv"
PERIODS = (1.0, 2.0, 5.0, 10.0, 20.0)  # ms
OVERSHOOT, ALONE, TOGETHER = 0.05, 3.0, 6.0  # of the step; s, a motor and a posture: what is asked of the default gains


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--gains", nargs="+", choices=GAINS, default=list(GAINS), metavar="SET", help=f"of {', '.join(GAINS)}")
    parser.add_argument("--periods", nargs="+", type=positive_number, default=list(PERIODS), metavar="MS", help="control periods in ms")
    parser.add_argument("--postures", type=positive_whole, default=10, metavar="N", help="steps of torso and arms together (default: 10)")
    parser.add_argument("--motors", nargs="+", metavar="MOTOR", help="that step alone (default: all)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Step every motor, then whole postures, at every period with both gain sets."""
    _require_motors(arguments.motors)
    path = folder / RECORDS
    done = {(r.gains, r.period_ms, r.step) for r in read_responses(path)}
    targets = postures(arguments.postures, arguments.seed)
    with Records(path, Response.columns()) as records, Progress() as progress:
        for number, gains in enumerate(arguments.gains):
            for place, period in enumerate(arguments.periods):
                share = (number + place / len(arguments.periods)) / len(arguments.gains)
                for response in responses(gains, period, arguments.motors, targets, arguments.seed, done):
                    records.append(response.record())
                    progress.show(share, f"{gains}, {period:g} ms: {response.step}")
    return results(read_responses(path))


def _require_motors(names: Sequence[str] | None) -> None:
    known = icub().robot.motors
    for name in names or ():
        if name not in known:
            raise UnknownName("motor", name, known)


def read_responses(path: Path) -> list[Response]:
    """What a run has so far."""
    return [Response.of_record(row) for row in read_records(path, Response.columns())]


def results(found: Sequence[Response]) -> dict[str, Any]:
    """Median and worst of each gain set and period."""
    table: dict[str, Any] = {}
    for gains in dict.fromkeys(r.gains for r in found):
        for period in dict.fromkeys(r.period_ms for r in found):
            for kind in ("motors", "postures"):
                mine = [r for r in found if (r.gains, r.period_ms, r.is_posture) == (gains, period, kind == "postures")]
                if not mine:
                    continue
                table.setdefault(gains, {})[f"{period:g} ms, {kind}"] = {
                    "steps": len(mine),
                    "never_settled": sum(not r.is_settled for r in mine),
                    "settling_time_s": _median_and_worst([r.settling for r in mine]),
                    "overshoot": _median_and_worst([r.overshoot for r in mine]),
                    "error_deg": _median_and_worst([r.error_deg for r in mine]),
                    "rest_deg": _median_and_worst([r.rest_deg for r in mine]),
                }
    judged = [r for r in found if r.gains == "default"]
    passed = all(r.is_settled and r.overshoot <= OVERSHOOT and r.settling <= (TOGETHER if r.is_posture else ALONE) for r in judged)
    return {"passed": passed if judged else None, "each": "median and worst", **table}


def _median_and_worst(values: Sequence[float]) -> list[float]:
    return [round(float(np.median(values)), 4), round(max(values), 4)]


def figure(folder: Path) -> Path:
    """Settling time and overshoot against the control period, and some of the responses."""
    return draw(read_responses(folder / RECORDS), folder / "settle.png")
