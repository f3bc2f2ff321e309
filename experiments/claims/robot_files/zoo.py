# SPDX-License-Identifier: Apache-2.0
"""The zoo: whether robots of other authors, with unchanged files, explore by curiosity, and the depth of their self-contacts meanwhile.

Claim: every robot of six collections loads as it is.  `mobee.derive` computes its arms with their joints, its home, the pairs that are
tested for contacts, and the fields (larger volumes around links, which cause repulsive forces).  The robot touches nothing at home.  In ten
minutes of curious exploration with the derived gains it touches itself no deeper than 2 mm.  A single agent tries every action of the
states that it visits.  If a robot fails, its line of the table names each failure.
Source: aims of this reproduction; the thesis has one robot.  Published number: none.  Run time: 15 seconds for each robot.

The collections are icub_models, pybullet_data, example-robot-data (URDF), robosuite, dm_control and kinova (MJCF).  The collection kinova
has the robots in the package dm_control that are by other makers.  --folders names the collections; without it, the packages that are
installed are searched, and kinova is left out.  All derived arms of a robot learn at once on one offline plant for --minutes of robot time;
the true positions of its motors are compared with its solids every 0.1 s.  Then the agent of one arm learns alone for --actions
transitions: the arm whose end can be moved farthest by a single motor.  The results of each robot are written before the next robot is
measured, and --resume continues after them.  The figure is a table in Markdown.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from experiments.claims.robot_files.urdf_files import SKIPPED_FOLDER, named_folders
from experiments.kit.command_line import Progress, positive_number
from experiments.kit.experiment import Experiment, Steps
from experiments.kit.run_folder import Records, Row, read_records
from mobee import CuriousAgent, Derived, Model, OfflinePlant, derive, load_robot
from mobee import run as run_agents
from mobee.check.run import check_robot
from mobee.errors import InvalidValue, MobeeError
from mobee.robot.mjcf.compiled import is_mjcf

RECORDS, REFUSED, TABLE = "zoo.csv", "refused.csv", "zoo.md"
MAX_DEPTH = 0.002  # m
CHECKED = 5  # ticks of 20 ms between two comparisons with the solids
DT = 0.02  # s
NO_ROBOT = ("no joint moves", "nothing to learn", "the robot has no link")  # in messages about things that are no robots


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the command-line options of this experiment to the parser."""
    text = "where to look for URDF and MJCF files, as NAME=PATH or PATH (default: packages that are installed)"
    parser.add_argument("--folders", nargs="+", default=[], metavar="DIR", help=text)
    parser.add_argument("--only", default="", metavar="TEXT", help="files with this in their path")
    parser.add_argument("--minutes", type=positive_number, default=10.0, metavar="M", help="of robot time (default: 10)")
    parser.add_argument("--actions", type=int, default=10_000, metavar="N", help="of the single agent (default: 10000; 0: none)")


@dataclass(frozen=True, slots=True)
class Measured(Row):
    """The measurements of one robot.

    `motors`: number of motors.  `arms`: names of the parts that learn.  `joints`: how many joints each of them has.  `errors`, `warnings`:
    how many errors and warnings `mobee check` finds in the derived robot.  `at_home`: number of contacts at home, of solids and fields.
    `load_s`, `derive_s`: times to load the file and to derive arms, limits and fields from it [s].  `transitions`: number of observed
    transitions while all arms learn at once.  `depth_mm`: depth of the deepest solid contact in this time; `touching`: names of the two
    solids.  One arm also learns alone; a state-action is one action in one state.  `tried`: number of state-actions that its agent tried.
    `can_be_tried`: number of state-actions in the states that the agent has visited.  `state_actions`: number of state-actions in all
    states.
    """

    robot: str
    motors: float
    arms: str
    joints: str
    errors: float
    warnings: float
    at_home: float
    load_s: float
    derive_s: float
    transitions: float
    depth_mm: float
    touching: str
    tried: float
    can_be_tried: float
    state_actions: float


def run(arguments: argparse.Namespace, folder: Path) -> dict[str, Any]:
    """Measure the robots that are not in the records in `folder` yet, write the table, and return the results of all."""
    files = dict(robot_files(named_folders(arguments.folders), arguments.only))
    if not files:
        raise InvalidValue("there is no URDF or MJCF file; name folders with --folders DIR, or install icub-models.")
    done = {one.robot for one in read(folder)} | {row["robot"] for row in read_refused(folder)}
    with (
        Records(folder / RECORDS, Measured.columns()) as records,
        Records(folder / REFUSED, ("robot", "why")) as refused,
        Progress() as progress,
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")  # the readers' warnings are for `mobee check`
        for number, (name, file) in enumerate(files.items()):
            progress.show(number / len(files), name)
            if name in done:
                continue
            try:
                records.append(measure(name, file, arguments.minutes, arguments.actions, arguments.seed).record())
            except MobeeError as error:
                refused.append({"robot": name, "why": _ascii(" ".join(str(error).replace(f"{file.parent}/", "").split()))})
    figure(folder)
    return results(folder)


def robot_files(folders: dict[str, Path], only: str) -> Iterator[tuple[str, Path]]:
    """Yield the name (ASCII) and the path of every URDF and MJCF file in the folders.

    `folders`: dict from the name of a set of files to its folder.  `only`: text that the name must contain.
    """
    for name, folder in folders.items():
        for path in sorted((*folder.rglob("*.urdf"), *folder.rglob("*.xml"))):
            label = _ascii(f"{name}/{path.relative_to(folder).as_posix()}")
            if SKIPPED_FOLDER not in path.parts and only in label and (path.suffix == ".urdf" or is_mjcf(path)):
                yield label, path


def _ascii(text: str) -> str:
    return text.encode("ascii", "backslashreplace").decode()


def measure(name: str, file: Path, minutes: float, actions: int, seed: int) -> Measured:
    """Measure one robot from its file; raises MobeeError if it cannot be read, or if no part of it can learn.

    `minutes`: robot time in which all arms learn.  `actions`: largest number of transitions of the agent that learns alone.  `seed`: of all
    random choices.
    """
    start = time.perf_counter()
    robot = load_robot(file)
    loaded = time.perf_counter()
    derived = derive(robot, seed=seed)
    ready = time.perf_counter()
    severities = [finding.severity for finding in check_robot(derived.robot)]
    transitions, depth, touching = babble(derived, minutes, seed)
    agent, visited = explore(derived, actions, seed)
    return Measured(
        robot=name,
        motors=float(len(robot.motors)),
        arms=" ".join(arm.part for arm in derived.arms),
        joints=" ".join(str(len(arm.joints)) for arm in derived.arms),
        errors=float(severities.count("error")),
        warnings=float(severities.count("warning")),
        at_home=float(len(Model(derived.robot).evaluate(derived.robot.home).contacts)),
        load_s=loaded - start,
        derive_s=ready - loaded,
        transitions=float(transitions),
        depth_mm=1e3 * depth,
        touching=touching,
        tried=float((agent.model.tries > 0).sum()),
        can_be_tried=float(sum(len(agent.space.actions(state)) for state in visited)),
        state_actions=float(agent.space.state_actions),
    )


def babble(derived: Derived, minutes: float, seed: int) -> tuple[int, float, str]:
    """Let all derived arms of a robot learn at once for `minutes` of robot time.

    Returns the number of transitions, the depth of the deepest solid contact [m], and the names of the two solids.  `seed`: of agents and
    plant.
    """
    plant = OfflinePlant(Model(derived.robot), seed, derived.gains, dt=DT, active=[arm.part for arm in derived.arms])
    solids = Model(replace(derived.robot, field_pairs=derived.robot.field_pairs[:0]))
    deepest = [(0.0, "")]

    def compare(seconds: float) -> None:
        deepest.extend((contact.depth, f"{contact.first} {contact.second}") for contact in solids.evaluate(plant.motors.q).contacts)
        deepest[:] = [max(deepest)]

    plant.every(CHECKED, compare)
    agents = [CuriousAgent(derived.space(arm), plant, seed=seed) for arm in derived.arms]
    while plant.time < 60.0 * minutes:
        run_agents(agents, len(agents))
    return sum(agent.transitions for agent in agents), deepest[0][0], _ascii(deepest[0][1])


def explore(derived: Derived, actions: int, seed: int) -> tuple[CuriousAgent, set[int]]:
    """Let one arm of a robot learn alone, and return its agent and the states that it has visited.

    It is the arm whose end can be moved farthest by a single motor (`movement` of a derived arm).  The run ends after `actions`
    transitions, or when every action of every visited state was tried.  `seed`: of agent and plant.
    """
    arm = max(derived.arms, key=lambda one: one.movement)
    plant = OfflinePlant(Model(derived.robot), seed, derived.gains, dt=DT, active=[arm.part])
    agent = CuriousAgent(derived.space(arm), plant, seed=seed)
    exists, visited = agent.space.goals >= 0, {agent.state} if actions else set[int]()
    while agent.transitions < actions and (exists & (agent.model.tries == 0))[list(visited)].any():
        agent.step()
        visited.add(agent.state)
    return agent, visited


def read(folder: Path) -> list[Measured]:
    """Read the measurements of all robots of a run from its folder."""
    return [Measured.of_record(row) for row in read_records(folder / RECORDS, Measured.columns())]


def read_refused(folder: Path) -> list[dict[str, str]]:
    """Read which files of a run were refused: a list with a dict for each file, with the keys "robot" (its name) and "why" (the reason)."""
    return read_records(folder / REFUSED, ("robot", "why"))


def failures(one: Measured) -> list[str]:
    """Return a text for each failure of a robot: deep contact, contacts at home, untried actions, errors by `mobee check`."""
    judged = {
        f"comes {one.depth_mm:.1f} mm into itself ({one.touching})": one.depth_mm > 1e3 * MAX_DEPTH,
        f"touches itself at home ({one.at_home:.0f} contacts)": one.at_home > 0,
        f"tries {one.tried:.0f} of {one.can_be_tried:.0f} actions": one.tried < one.can_be_tried,
        f"has {one.errors:.0f} errors by `mobee check`": one.errors > 0,
    }
    return [text for text, failed in judged.items() if failed]


def results(folder: Path) -> dict[str, Any]:
    """Return the results of the run in `folder`.

    Main keys: "robots": number of robots that were measured; "within 2 mm": number of robots whose contacts stay so shallow; "tried all
    that can be tried": number of robots whose single agent tried every action of the states that it visited; "meet the claim": number of
    robots without a failure; "cannot": dict from the name of a robot that does not meet the claim to a text with its failures;
    "refused": dict from the name of a file that could not be used to the reason; "no robots": number of files that hold nothing that can
    learn; "passed": whether all robots meet the claim, None if no robot was measured.
    """
    found, refused = read(folder), read_refused(folder)
    failed = {one.robot: "; ".join(failures(one)) for one in found if failures(one)}
    things = [row["robot"] for row in refused if any(text in row["why"] for text in NO_ROBOT)]
    return {
        "passed": not failed if found else None,
        "robots": len(found),
        "meet the claim": len(found) - len(failed),
        "within 2 mm": sum(one.depth_mm <= 1e3 * MAX_DEPTH for one in found),
        "tried all that can be tried": sum(one.tried >= one.can_be_tried > 0 for one in found),
        "cannot": failed,
        "refused": {row["robot"]: row["why"] for row in refused if row["robot"] not in things},
        "no robots": len(things),
    }


def figure(folder: Path) -> Path:
    """Write a Markdown file with the table of robots and of refused files in `folder`; returns its path."""
    path = folder / TABLE
    refused = [row for row in read_refused(folder) if not any(text in row["why"] for text in NO_ROBOT)]
    lines = [*table(read(folder)), "", "| refused | why |", "|---|---|", *(f"| {row['robot']} | {row['why']} |" for row in refused), ""]
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


def table(found: Sequence[Measured]) -> list[str]:
    """Return the measurements as the lines of a Markdown table, one robot per line."""
    heads = "robot | motors | arms (joints) | transitions | deepest [mm] | tried of what can be tried | cannot"
    lines = [f"| {heads} |", "|---" * 7 + "|"]
    for one in found:
        arms = ", ".join(f"{part} ({joints})" for part, joints in zip(one.arms.split(), one.joints.split(), strict=True))
        tried = f"{one.tried:.0f} of {one.can_be_tried:.0f}" if one.can_be_tried else ""
        cells = [one.robot, f"{one.motors:.0f}", arms, f"{one.transitions:.0f}", f"{one.depth_mm:.2f}", tried, "; ".join(failures(one))]
        lines.append("| " + " | ".join(cells) + " |")
    return lines


EXPERIMENT = Experiment(
    claim="robots of six collections become curious without an edit, and stay out of themselves within 2 mm",
    source="aims of this reproduction",
    method=Steps(add_arguments, run, figure),
)
