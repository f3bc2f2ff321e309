"""Own robots: do URDFs of others work as they are, without expert knowledge?

Claim: of 28 robots from 4 to 300 motors each stays within 0.5 degrees or 1 mm of its home, none touches itself there once
`mobee check --write-srdf` has written what does, each slide comes to rest within 1 mm from 5 to 95 % of its range, and 250 curious
actions of an arm take at most 15 s, from the file on.
Source: aims of this reproduction; the thesis has one robot.  Published number: none.  Run time: 5 minutes.

Robots of example-robot-data 6.0.0 and pybullet_data, and four that nobody would build: a chain of 200 joints, a star of 300, and an arm
six orders of magnitude too small and one three too large.  Model, default gains and the motors of the offline plant, an empty world, no
fields; home and actions also with fields of 3 cm, whose drift is told and not judged: where fields meet at home, they push.  The joints'
true positions count; of a slide also what the encoders say.  Times are those of the machine, the engine compiled.  The figure is a table
in markdown.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from experiments.kit.command_line import Progress
from experiments.kit.records import Records, read_records
from experiments.own_robots.measure import Measured, measure
from experiments.own_robots.robots import ROBOTS, examples_folder, robot_file
from mobee import Model, OfflinePlant, load_robot
from mobee.errors import RobotFileError

NAME = "own-robots"
CLAIM = "28 URDFs of others stay at home, touch nothing there, settle within 1 mm, and explore within 15 s"
SOURCE = "aims of this reproduction"

RECORDS, REFUSED, TABLE = "own_robots.csv", "refused.csv", "own_robots.md"
DEGREES, MILLIMETRES, SECONDS = 0.5, 1.0, 15.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Options."""
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS), metavar="ROBOT", help=f"of {', '.join(ROBOTS)}")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="robots of example-robot-data (default: those of the package)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Measure what is left."""
    examples = arguments.data or examples_folder()
    done = {row["robot"] for row in read_records(folder / RECORDS, Measured.columns())}
    done |= {row["robot"] for row in read_records(folder / REFUSED, ("robot", "why"))}
    OfflinePlant(Model(load_robot("katana"))).run(1)  # loads, or compiles, the engine
    with (
        Records(folder / RECORDS, Measured.columns()) as records,
        Records(folder / REFUSED, ("robot", "why")) as refused,
        Progress() as progress,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # what the readers say of these files is for `mobee check`
        for number, name in enumerate(arguments.robots):
            if name in done:
                continue
            progress.show(number / len(arguments.robots), name)
            try:
                records.append(measure(name, robot_file(name, examples, folder), folder, arguments.seed).record())
            except RobotFileError as error:
                refused.append({"robot": name, "why": str(error)})
    return results(folder)


def read(folder: Path) -> list[Measured]:
    """What a run has so far."""
    return [Measured.of_record(row) for row in read_records(folder / RECORDS, Measured.columns())]


def failures(one: Measured) -> list[str]:
    """What a robot does not do that is claimed."""
    judged = {
        "drifts": one.drift_deg > DEGREES or one.drift_mm > MILLIMETRES,
        "touches itself at home": one.touching_after > 0,
        "slide off": one.slide_mm > MILLIMETRES or one.unsettled > 0,
        "slow": max(one.actions_s, one.field_actions_s) > SECONDS,
    }
    return [name for name, failed in judged.items() if failed]


def results(folder: Path) -> dict[str, Any]:
    """The worst of each, and which robots fail."""
    found, refused = read(folder), read_records(folder / REFUSED, ("robot", "why"))
    failed = {one.robot: failures(one) for one in found if failures(one)}
    return {
        "passed": not failed and not refused if found else None,
        "robots": len(found),
        "refused": {row["robot"]: row["why"] for row in refused},
        "failed": failed,
        "touch themselves at home": sum(one.touching > 0 for one in found),
        "and with the SRDF": sum(one.touching_after > 0 for one in found),
        "worst_drift_deg": max((one.drift_deg for one in found), default=None),
        "worst_drift_with_fields_deg": max((one.field_drift_deg for one in found), default=None),
        "worst_drift_mm": max((one.drift_mm for one in found), default=None),
        "worst_slide_mm": max((one.slide_mm for one in found), default=None),
        "longest_srdf_s": max((one.srdf_s for one in found), default=None),
        "longest_actions_s": max((max(one.actions_s, one.field_actions_s) for one in found), default=None),
    }


def figure(folder: Path) -> Path:
    """The table, a robot a line."""
    path = folder / TABLE
    path.write_text("\n".join([*table(read(folder)), ""]), encoding="utf-8")
    return path


def table(found: Sequence[Measured]) -> list[str]:
    """In markdown."""
    heads = "robot | motors (slides) | solids | contacts at home | pairs written (s) | contacts then | drift [deg] | drift [mm] | "
    heads += "slides within [mm] | 250 actions [s] | touching after them | fields: drift [deg] | 250 actions [s] | touching after them"
    lines = [f"| {heads} |", "|---" * 14 + "|"]
    for one in found:
        motors = f"{one.motors} ({one.slides})" if one.slides else f"{one.motors}"
        lengths = (one.drift_deg, one.drift_mm, one.slide_mm, one.field_drift_deg)
        degrees, *mm, with_fields = (f"{value:.2f}" if value >= 0.0 else "" for value in lengths)
        cells = [one.robot, motors, one.shapes, one.touching, f"{one.written} ({one.srdf_s:.1f})", one.touching_after, degrees, *mm]
        cells += [f"{one.actions_s:.1f}", one.solid, with_fields, f"{one.field_actions_s:.1f}", one.field_solid]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines
