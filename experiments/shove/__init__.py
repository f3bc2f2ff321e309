"""Somebody shoves the robot's arm: what MoBeE promises, and what it does not.

Claim: MoBeE protects the robot from itself, not from energy that comes from outside (thesis 5.2, footnote 4: Justin "can sense when there
is too much energy in the system ... and apply brakes"; MoBeE has "no such emergency stop").  Measured here: up to which force at the
hand nothing touches, from where on solids touch, a constraint is violated or a motor is driven into its stop, and that the robot goes back
where it was when it is let go.  Source: thesis 5.2, footnote 4.  Published: no numbers.  Run time: a minute.

A shove is a force at the left hand for 0.4 s while the controller holds the posture.  It moves the joints by what J^T makes of it and the
motors' inertia and friction (those of the torque modality); the controller feels only where the joints have gone.  With MoBeE off the
same shove meets a robot that does not answer.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from experiments.kit.progress import Progress
from experiments.kit.records import Records, read_records
from experiments.shove.figure import draw
from experiments.shove.shoving import DIRECTIONS, FORCES, LAWS, Shoved, shove

NAME = "shove"
CLAIM = "MoBeE gives way to a shove and comes back, but energy from outside can drive it into contact"
SOURCE = "thesis 5.2, footnote 4"

RECORDS = "shove.csv"
BACK = 5.0  # mm from where the hand was, after the shove
GENTLE = 5.0  # N: up to here nothing may touch, with the default gains


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    choices = tuple(DIRECTIONS)
    parser.add_argument("--laws", nargs="+", choices=LAWS, default=list(LAWS), metavar="LAW", help=f"of {', '.join(LAWS)}")
    parser.add_argument("--directions", nargs="+", choices=choices, default=list(choices), metavar="WHERE", help=f"of {', '.join(choices)}")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Shove in every direction with ever more force."""
    path = folder / RECORDS
    done = {(s.law, s.direction, s.force) for s in read_shoved(path)}
    cases = [(law, direction, force) for law in arguments.laws for direction in arguments.directions for force in FORCES]
    with Records(path, Shoved.columns()) as records, Progress() as progress:
        for number, case in enumerate(cases):
            if case not in done:
                records.append(shove(*case, arguments.seed).record())
            progress.show(number / len(cases), " ".join(map(str, case)))
    return results(read_shoved(path))


def read_shoved(path: Path) -> list[Shoved]:
    """What a run has so far."""
    return [Shoved.of_record(row) for row in read_records(path, Shoved.columns())]


def results(found: list[Shoved]) -> dict[str, Any]:
    """For each law and direction the least force at which something happened, None where it did not up to the strongest."""
    table: dict[str, Any] = {}
    for law in dict.fromkeys(s.law for s in found):
        for direction in dict.fromkeys(s.direction for s in found):
            mine = sorted((s for s in found if s.law == law and s.direction == direction), key=lambda s: s.force)
            table.setdefault(law, {})[direction] = {
                "solids_touch_from_N": next((s.force for s in mine if s.solid_mm > 0.0), None),
                "constraint_violated_from_N": next((s.force for s in mine if s.clause_deg > 0.0), None),
                "motor_into_its_stop_from_N": next((s.force for s in mine if s.stop_deg_s > 0.0), None),
                "deepest_solid_mm": max((s.solid_mm for s in mine), default=0.0),
                "back_within_mm": max((s.away_mm for s in mine if s.force <= GENTLE), default=0.0),
            }
    judged = [s for s in found if s.law == "default" and s.force <= GENTLE]
    passed = all(s.solid_mm == 0.0 and s.clause_deg <= 0.0 and s.away_mm <= BACK for s in judged)
    return {"passed": passed if judged else None, **table}  # the claim is about the default gains


def figure(folder: Path) -> Path:
    """Depths against force for every direction."""
    return draw(read_shoved(folder / RECORDS), folder / "shove.png")
