# SPDX-License-Identifier: Apache-2.0
"""Own robots: whether URDFs by other authors work as they are, without expert knowledge.

Claim: each of 28 robots with 4 to 300 motors stays within 0.5 degrees or 1 mm of its home.  None touches itself at home, if a file that
`mobee check --write-srdf` has written excludes the pairs of links that touch there.  Each prismatic joint settles within 1 mm of goals from
5 to 95 % of its range.  To read the robot's file and let a curious agent make 250 actions of an arm takes at most 15 s.
Source: aims of this reproduction; the thesis has one robot.  Published number: none.  Run time: 5 minutes.

The robots are those of example-robot-data 6.0.0 and pybullet_data, and four extreme ones: a chain of 200 joints, a star of 300, and an arm
six orders of magnitude too small and one three too large.  They have default gains, the motors of the offline plant (a robot simulated in
one process), an empty world and no fields (volumes around the links, which exert forces but are not solid).  The drift from home and the
actions of the agent are also measured with fields of 3 cm; that drift is printed but not judged, because fields that overlap at home push
the robot.  Errors are those of the true joint positions; for a prismatic joint the error of its encoder value counts too.  Times are those
of this machine.  The figure is a table in Markdown.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.claims.robot_files.sample_robots import ROBOTS, examples_folder, robot_file
from experiments.kit.command_line import Progress
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.run_folder import Records, Row, read_records
from mobee import CuriousAgent, Lattice, Model, OfflinePlant, load_robot
from mobee.arrays import Array
from mobee.check.touching import leave_out_touching
from mobee.errors import RobotFileError
from mobee.robot.motor_units import slides
from mobee.robot.robot import Robot

RECORDS, REFUSED, TABLE = "own_robots.csv", "refused.csv", "own_robots.md"
MAX_DEGREES, MAX_MILLIMETRES, MAX_SECONDS = 0.5, 1.0, 15.0
HOME_SECONDS = 10.0  # s
ACTIONS = 250
RANGE_SHARES = (0.05, 0.275, 0.5, 0.725, 0.95, 0.5, 0.05)  # of a prismatic joint's range
ARM_JOINTS = 4  # of an arm
FIELD_SIZE = 0.03  # m


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    parser.add_argument("--robots", nargs="+", choices=ROBOTS, default=list(ROBOTS), metavar="ROBOT", help=f"of {', '.join(ROBOTS)}")
    parser.add_argument("--data", type=Path, metavar="FOLDER", help="robots of example-robot-data (default: those of the package)")


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Measure how well the library works with each robot (`Measured`), and return the results of all.

    Robots that are already in the records in `folder` are not measured again.
    Raises InvalidValue if example-robot-data or pybullet_data is needed and missing.
    """
    examples = arguments.data or examples_folder()
    done = {row["robot"] for row in read_records(folder / RECORDS, Measured.columns())}
    done |= {row["robot"] for row in read_records(folder / REFUSED, ("robot", "why"))}
    OfflinePlant(Model(load_robot("katana"))).run(1)  # loads the engine
    with (
        Records(folder / RECORDS, Measured.columns()) as records,
        Records(folder / REFUSED, ("robot", "why")) as refused,
        Progress() as progress,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # the readers' warnings are for `mobee check`
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
    """Read the measurements of all robots of a run from its folder."""
    return [Measured.of_record(row) for row in read_records(folder / RECORDS, Measured.columns())]


def failures(one: Measured) -> list[str]:
    """Return a short text for each limit of the claim that a robot exceeds, as "drifts" or "slow"; [] if it exceeds none."""
    judged = {
        "drifts": one.drift_deg > MAX_DEGREES or one.drift_mm > MAX_MILLIMETRES,
        "touches itself at home": one.touching_after > 0,
        "slide off": one.slide_mm > MAX_MILLIMETRES or one.unsettled > 0,
        "slow": max(one.actions_s, one.field_actions_s) > MAX_SECONDS,
    }
    return [name for name, failed in judged.items() if failed]


def results(folder: Path) -> dict[str, Any]:
    """Return the worst value of each measurement over all robots of the run in `folder`, the robots that fail, and "passed".

    "robots": number of robots that could be read.  "failed": dict from the name of a robot that fails to the texts that `failures` returns
    for it.  "refused": dict from the name of a robot that could not be read to the reason.  "touch themselves at home": number of robots
    with contacts at home before an SRDF (a file that lists pairs of links not to be tested) is written; "and with the SRDF": the same with
    the written SRDF.  "worst_..." and "longest_...": the worst values, None without robots.  "passed": whether no robot failed or was
    refused, None without robots.
    """
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
    """Write a table of the measurements, one line per robot of the run in `folder`, to a Markdown file there; return the file's path."""
    path = folder / TABLE
    path.write_text("\n".join([*table(read(folder)), ""]), encoding="utf-8")
    return path


def table(found: Sequence[Measured]) -> list[str]:
    """Return the measurements as the lines of a Markdown table, one robot per line."""
    heads = "robot | motors (slides) | solids | contacts at home | pairs written (s) | contacts then | drift [deg] | drift [mm] | "
    heads += "slides within [mm] | 250 actions [s] | touching after them | fields: drift [deg] | "
    heads += "fields: 250 actions [s] | fields: touching after them"
    lines = [f"| {heads} |", "|---" * 14 + "|"]
    for one in found:
        motors = f"{one.motors} ({one.slides})" if one.slides else f"{one.motors}"
        lengths = (one.drift_deg, one.drift_mm, one.slide_mm, one.field_drift_deg)
        degrees, *mm, with_fields = (f"{value:.2f}" if value >= 0.0 else "" for value in lengths)
        cells = [one.robot, motors, one.shapes, one.touching, f"{one.written} ({one.srdf_s:.1f})", one.touching_after, degrees, *mm]
        cells += [f"{one.actions_s:.1f}", one.solid, with_fields, f"{one.field_actions_s:.1f}", one.field_solid]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return lines


@dataclass(frozen=True, slots=True)
class Measured(Row):
    """The measurements of one robot; -1 where there is nothing to measure.

    `motors`, `slides` and `shapes`: numbers of motors, of prismatic motors, and of shapes.  `touching`: number of solid contacts at home
    before an SRDF is written.  `written`: number of pairs written to the SRDF, a file that lists pairs of links not to be tested;
    `touching_after`: number of contacts at home with this SRDF; `srdf_s`: time to write it [s].  `drift_deg`, `drift_mm`: largest distance
    of a revolute and of a prismatic motor from home, while home is the attractor for 10 s.  `slide_mm`: worst error of a prismatic joint
    over its range; `unsettled`: number of actions of prismatic joints that timed out.  `actions_s`: time from the file to the end of 250
    curious actions [s]; `solid`: how many of these actions ended with solids in contact.  `field_drift_deg`, `field_actions_s`,
    `field_solid`: the same as the names without "field_", for the robot with fields (volumes that are not solid) of 3 cm.
    """

    PLACES = 4

    robot: str
    motors: int
    slides: int
    shapes: int
    touching: int
    written: int
    touching_after: int
    srdf_s: float
    drift_deg: float
    drift_mm: float
    slide_mm: float  # the worst error of a prismatic joint over RANGE_SHARES
    unsettled: int
    actions_s: float
    solid: int
    field_drift_deg: float
    field_actions_s: float
    field_solid: int


def measure(name: str, urdf: Path, folder: Path, seed: int) -> Measured:
    """Measure one robot: contacts at home, drift, prismatic joints, and time to learn; raises MobeeError if it cannot be read.

    `name`: name of the robot.  `urdf`: its file.  `folder`: folder for the SRDF that is written.  `seed`: of all random choices.
    """
    robot = load_robot(urdf)
    before = Model(robot).evaluate(robot.home)
    start = time.perf_counter()
    done = leave_out_touching(urdf, folder / f"{name.replace(' ', '_')}.srdf")
    srdf_s = time.perf_counter() - start
    robot = load_robot(urdf, srdf=done.path)
    model = Model(robot)
    drift = _drift(model, seed)
    sliding = np.array([slides(robot, motor) for motor in robot.motor_table])
    found = [_slide(model, int(i), seed) for i in np.flatnonzero(sliding)]
    actions_s, solid = _explore(urdf, done.path, None, seed)
    field_drift = _drift(Model(load_robot(urdf, srdf=done.path, field=FIELD_SIZE)), seed)
    field_actions_s, field_solid = _explore(urdf, done.path, FIELD_SIZE, seed)
    return Measured(
        robot=name,
        motors=len(robot.motors),
        slides=int(sliding.sum()),
        shapes=len(robot.shapes),
        touching=int(before.count),
        written=len(done.pairs),
        touching_after=done.touching,
        srdf_s=srdf_s,
        drift_deg=_degrees(drift[~sliding]),
        drift_mm=float(1e3 * drift[sliding].max()) if sliding.any() else -1.0,
        slide_mm=max((1e3 * worst for worst, _ in found), default=-1.0),
        unsettled=sum(late for _, late in found),
        actions_s=actions_s,
        solid=solid,
        field_drift_deg=_degrees(field_drift[~sliding]),
        field_actions_s=field_actions_s,
        field_solid=field_solid,
    )


def _degrees(drift: Array) -> float:
    return float(np.rad2deg(drift.max())) if len(drift) else -1.0


def _drift(model: Model, seed: int) -> Array:
    """Return the largest distance of each motor from home (n,), in its unit, while home is the attractor for HOME_SECONDS."""
    plant = OfflinePlant(model, seed)
    plant.controller.attractor = model.robot.home
    trace = plant.run(round(HOME_SECONDS / plant.dt))
    most: Array = np.abs(trace.q - model.robot.home).max(axis=0)
    return most


def _slide(model: Model, index: int, seed: int) -> tuple[float, int]:
    """Move a prismatic joint through its range, the other motors at home; returns its worst error [m] and the number of timeouts."""
    motor = model.robot.motor_table[index]
    part = model.robot.part(motor.part)
    plant, target = OfflinePlant(model, seed), model.robot.home[part.slice].copy()
    worst, late = 0.0, 0
    for share in RANGE_SHARES:
        target[index - part.start] = motor.limits[0] + share * np.ptp(motor.limits)
        outcome = plant.act(motor.part, target)
        wrong = abs(outcome.q - target)[index - part.start], abs(plant.motors.q[part.slice] - target)[index - part.start]
        worst, late = max(worst, *map(float, wrong)), late + (not outcome.settled)
    return worst, late


def arm_of(robot: Robot) -> list[str]:
    """Return the names of up to four (ARM_JOINTS) revolute motors of one part, for an agent.

    First come motors of one of the longest chains of joints, in order from the base, then other motors of the same part.
    """
    chains: list[list[int]] = [[]]
    drive = {joint: k for k, motor in enumerate(robot.motor_table) for joint, _, _ in motor.joints}
    for index, joint in enumerate(robot.joints):
        chains.append([*chains[joint.parent], *([drive[index]] if index in drive else [])])
    turning = [k for k, motor in enumerate(robot.motor_table) if not slides(robot, motor)]
    best: list[int] = []
    for chain in sorted(chains, key=len, reverse=True)[:20]:
        for part in robot.parts.values():
            mine = [k for k in dict.fromkeys(chain) if k in turning and part.slice.start <= k < part.slice.stop]
            best = mine if len(mine) > len(best) else best
    part = robot.part(robot.motor_table[best[0]].part)
    more = [k for k in turning if part.slice.start <= k < part.slice.stop and k not in best]
    return [robot.motors[k] for k in [*best, *more][:ARM_JOINTS]]


def _explore(urdf: Path, srdf: Path, field: float | None, seed: int) -> tuple[float, int]:
    """Load a robot and make ACTIONS curious actions; returns the seconds of both, and after how many actions solids were in contact.

    `field`: distance [m] by which the field of each solid (a volume that causes a repulsive force) extends beyond it; None: no fields.
    """
    start = time.perf_counter()
    robot = load_robot(urdf, srdf=srdf, field=field)
    plant = OfflinePlant(Model(robot), seed)
    agent = CuriousAgent(Lattice(robot, arm_of(robot)), plant, seed=seed)
    seconds, solid = 0.0, 0
    for _ in range(ACTIONS):
        agent.step()
        seconds += time.perf_counter() - start
        pose = plant.pose
        solid += pose is not None and bool(pose.count)
        start = time.perf_counter()
    return seconds, solid


EXPERIMENT = Experiment(
    claim="28 URDFs of others stay at home, touch nothing there, settle within 1 mm, and explore within 15 s",
    source="aims of this reproduction",
    method=Steps(add_arguments, run, figure),
)
