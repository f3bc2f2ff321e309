"""Thesis Algorithm 1, FLOOD_MODEL: how often can the model be evaluated while its world changes without any waiting?

Claim: every joint moves, one thread removes and creates boxes as fast as it can, ever more of them; the model gives a consistent
answer hundreds of times a second for the iCub among hundreds of boxes, and more often for the Katana.  Source: thesis 2.4,
figure 2.4.  Published: "hundreds of poses per second for a humanoid with hundreds of obstacles" on a dual-core 2.4 GHz laptop;
the figure's curves are not given as numbers.  Run time: three to five minutes for the whole algorithm, 1000 numbers of
objects with 1000 removals and creations each, for both robots.

`--check` runs the endurance instead: several threads add, move, remove, attach, detach and change roles in one world while the
model evaluates; no evaluation may see a torn world, nothing may raise, memory must stay flat.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path
from typing import Any

from experiments.flood.algorithm import flood_model
from experiments.flood.endurance import COLUMNS as ENDURANCE_COLUMNS
from experiments.flood.endurance import RECORDS as ENDURANCE
from experiments.flood.endurance import endure
from experiments.flood.figure import draw, draw_endurance
from experiments.flood.rates import SHORTEST, rates
from experiments.flood.records import COLUMNS, Record, read_flood
from experiments.kit.options import positive_number, positive_whole
from experiments.kit.progress import Progress
from experiments.kit.records import Records, read_records

NAME = "flood"
CLAIM = "the model evaluates hundreds of poses a second while its world is flooded with edits"
SOURCE = "thesis 2.4, Algorithm 1 and figure 2.4"

ROBOTS = ("katana", "icub")
RECORDS = "flood.csv"
ENDURANCE_LASTS = 600.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS), metavar="ROBOT", help=f"of {', '.join(ROBOTS)}")
    parser.add_argument("--objects", type=positive_whole, default=1000, metavar="N", help="up to so many boxes (default: 1000)")
    parser.add_argument("--edits", type=positive_whole, default=1000, metavar="N", help="replaced boxes at each number (default: 1000)")
    parser.add_argument("--duration", type=positive_number, metavar="S", help="end after so many seconds (default: never; --check: 600)")
    parser.add_argument("--check", action="store_true", help="endurance: many threads, every evaluation checked")
    parser.add_argument("--threads", type=positive_whole, default=4, metavar="N", help="that edit, with --check (default: 4)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Flood each robot's model, or check its endurance."""
    if arguments.check:
        return endure(folder, threads=arguments.threads, duration=arguments.duration or ENDURANCE_LASTS, seed=arguments.seed)
    give_up = time.monotonic() + arguments.duration if arguments.duration else float("inf")
    path = folder / RECORDS
    done = read_flood(path)
    with Records(path, COLUMNS) as records, Progress() as progress:
        for robot in arguments.robots:
            flooded = [record["objects"] for record in done if record["robot"] == robot and record["edits"]]
            first, last = max(flooded, default=0) + 1, arguments.objects
            for record in flood_model(
                robot, first=first, last=last, edits=arguments.edits, seed=arguments.seed, is_over=lambda: time.monotonic() > give_up
            ):
                records.append(record)
                progress.show(record["objects"] / last, _line(record))
    return results(read_flood(path), arguments)


def results(records: list[Record], arguments: argparse.Namespace) -> dict[str, Any]:
    """Evaluations a second near some numbers of objects, flooded and still, and edits a second, for each robot."""
    found: dict[str, Any] = {}
    for robot in arguments.robots:
        mine = [record for record in records if record["robot"] == robot]
        flooded, still = [r for r in mine if r["edits"]], [r for r in mine if not r["edits"]]
        seconds = sum(r["seconds"] for r in flooded)
        found[robot] = {
            "evaluations_per_second_flooded": dict(rates(flooded)),
            "evaluations_per_second_still": dict(rates(still)),
            "edits_per_second": round(sum(r["edits"] for r in flooded) / max(seconds, 1e-9)),
            "objects_reached": max((r["objects"] for r in flooded), default=0),
        }
        if seconds < SHORTEST:
            found[robot]["note"] = f"flooded for {seconds:.2g} s, too short for a rate: give more --edits or --objects"
    is_complete = all(found[robot]["objects_reached"] >= arguments.objects for robot in arguments.robots)
    return {"complete": is_complete, **found}


def figure(folder: Path) -> Path:
    """Figure 2.4 from the records of a run; of an endurance run, its course."""
    endured = read_records(folder / ENDURANCE, ENDURANCE_COLUMNS)
    if endured:
        return draw_endurance(endured, folder / "endurance.png")
    return draw(read_flood(folder / RECORDS), folder / "flood.png")


def _line(record: Record) -> str:
    rate = record["evaluations"] / record["seconds"]
    return f"{record['robot']}, {record['objects']} objects: {rate:.0f} evaluations/s, {record['edits'] / record['seconds']:.0f} edits/s"
