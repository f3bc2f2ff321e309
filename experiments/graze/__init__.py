"""Does the robot recover when its hand comes into the table's field at a low angle?

Claim: the reflex of MoBeE 1.0 recovers from a contact that it meets head on; where the hand comes in flat its recovery fails ever
more often and control goes back and forth, as the encoders' noise decides what counts as contact; a filter and a dead time mend
most of that; MoBeE 2.0 lets the hand slide along the surface at any angle, and settles.  Source: thesis 4.4 (discussion), which
gives no numbers.  Run time: 5 to 10 minutes for 10 angles with 30 trials of each of four variants.

A client drives the left hand on a straight way through the surface of the table's field, 6 cm before it and 4 cm behind, at 20 % speed,
and tries again whenever it gets control back, for 12 s.  Motors with lag, delay, play and encoder noise, ticks of 10 ms.  Variants:
off = nobody steps in; naive = MoBeE 1.0 as chapter 4.1 describes it; mended = with filter and dead time; 2.0 = the client's references
are attractors of the controller.  The first recovery of each trial counts.  It is a success when the hand ends out of contact, has not come
into contact again nor gone deeper on the way back, and the reflex does not come again within 0.3 s; it is clean when besides the reflex
saw nothing of the contact any more on the way back.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from experiments.graze.approach import Table
from experiments.graze.figure import draw
from experiments.graze.records import as_record, read_trials
from experiments.graze.trial import COLUMNS, VARIANTS, Trial, run_trial
from experiments.kit.options import positive_number, positive_whole
from experiments.kit.progress import Progress
from experiments.kit.records import Records

NAME = "graze"
CLAIM = "rewinding fails the more often the flatter the hand comes into contact; MoBeE 2.0 slides and settles at every angle"
SOURCE = "thesis 4.4"

RECORDS = "graze.csv"
ANGLES = (90.0, 60.0, 30.0, 20.0, 10.0, 7.0, 5.0, 3.0, 2.0, 1.0)  # degrees
SHARES = ("recovered", "clean", "again", "came_back", "never", "deeper", "relapse", "settled", "switches", "flips", "flicker")
LOW = 3.0  # degrees, up to which a way counts as flat


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--angles", nargs="+", type=positive_number, default=list(ANGLES), metavar="DEGREES", help="of the approach")
    parser.add_argument("--spots", type=positive_whole, default=10, metavar="N", help="places on the table (default: 10)")
    parser.add_argument("--repeat", type=positive_whole, default=3, metavar="N", help="trials at each place, other noise (default: 3)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """All variants at every angle, place and seed of the noise."""
    path = folder / RECORDS
    done = {(trial.variant, trial.angle, trial.spot, trial.seed) for trial in read_trials(path)}
    table = Table()
    spots = table.spots(arguments.spots, arguments.seed)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for number, angle in enumerate(arguments.angles):
            for place, spot in enumerate(spots):
                way = table.way(spot, np.deg2rad(angle))
                if way is None:
                    continue
                progress.show((number + place / len(spots)) / len(arguments.angles), f"{angle:g} degrees, place {place + 1}")
                for seed in range(arguments.seed, arguments.seed + arguments.repeat):
                    for variant in VARIANTS:
                        if (variant, angle, place, seed) not in done:
                            records.append(as_record(run_trial(table, way, variant, angle, place, seed)))
    return results(read_trials(path))


def results(trials: Sequence[Trial]) -> dict[str, Any]:
    """Every variant's numbers at every angle, and whether the claim holds."""
    angles = sorted({trial.angle for trial in trials}, reverse=True)
    found: dict[str, Any] = {
        variant: {f"{angle:g}": summary([t for t in trials if (t.variant, t.angle) == (variant, angle)]) for angle in angles}
        for variant in VARIANTS
    }
    return {"passed": holds(trials), **found}


def summary(trials: Sequence[Trial]) -> dict[str, float]:
    """The trials of one variant at one angle: shares of all, depths in mm, rates a second."""
    if not trials:
        return {"trials": 0}

    def share(name: str) -> float:
        return round(float(np.mean([getattr(trial, name) for trial in trials])), 3)

    return {
        "trials": len(trials),
        **{name: share(name) for name in SHARES},
        "depth_mm_median": round(1e3 * float(np.median([trial.depth for trial in trials])), 1),
        "depth_mm_max": round(1e3 * max(trial.depth for trial in trials), 1),
        "solid_mm_max": round(1e3 * max(trial.solid for trial in trials), 1),
        "progress_cm": round(1e2 * float(np.mean([trial.progress for trial in trials])), 1),
    }


def holds(trials: Sequence[Trial]) -> bool:
    """The claim: flat ways are worse for the naive reflex than steep ones, the mended one is better there, and 2.0 settles."""

    def share(name: str, variant: str, low: bool) -> float:
        values = [getattr(t, name) for t in trials if t.variant == variant and (t.angle <= LOW) == low]
        return float(np.mean(values)) if values else float("nan")

    naive_low, naive_steep = share("recovered", "naive", True), share("recovered", "naive", False)
    switching = share("switches", "mended", True) < share("switches", "naive", True)
    deflected = [trial for trial in trials if trial.variant == "2.0"]
    calm = bool(deflected) and all(t.settled and t.solid == 0.0 for t in deflected)
    return naive_low < naive_steep and share("recovered", "mended", True) > naive_low and switching and calm


def figure(folder: Path) -> Path:
    """Recovery, switching, depth and how far the hand gets, against the angle."""
    return draw(read_trials(folder / RECORDS), folder / "graze.png")
