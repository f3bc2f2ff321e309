# SPDX-License-Identifier: Apache-2.0
"""Runs equal agents on the offline plant and on the live processes in lockstep; stores finished transitions on disk."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.kit.cells import Cell
from experiments.kit.learning.exploration import explore_together
from experiments.kit.live.launch import LaunchFailed, summary_of
from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, load_robot, load_world
from mobee.plant import Plant
from mobee.robot.robot import Robot
from mobee.store import STORE, TransitionStore

ROBOT, GAINS, RATE = "icub", "published_2014", 50  # RATE in Hz
JOINTS = {
    "torso": ("torso_yaw", "torso_roll", "torso_pitch"),
    "left_arm": ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"),
    "right_arm": ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"),
}
ROBOTS = {  # settings of robot_sim; the identified motor model was fitted to the PyBullet robot
    "pybullet": {"backend": "pybullet", "motors": "published"},
    "mujoco": {"backend": "mujoco", "motors": "published"},
    "kinematic": {"backend": "kinematic", "motors": "identified"},
}
PIECE = 200  # transitions of each part in one launch
_ACTION_TIME = 7.0  # s of robot time for an action, a little above the torso's mean at the table
_MAX_IDLE = 3  # launches in a row without a new transition

_SCENARIO = """# Written by an experiment.
title = "Learning on {robot}, to be compared with the offline plant"

[shared]
robot = "{model}"
world = "{world}"
gains = "{gains}"
seed = {seed}
mode = "lock"

[services.robot_sim]
backend = "{backend}"
motors = "{motors}"
rate = {rate}

[services.model]
[services.controller]
"""
_AGENT = """
[services.agent_{part}]
joints = {joints}
neighbours = {neighbours}
seed = {agent_seed}
run_dir = "{folder}"
transitions = {transitions}
"""


@dataclass(frozen=True, slots=True)
class Task:
    """The parts that learn, each with its number of actions per state, and their world."""

    world: str
    neighbours: Mapping[str, int]

    @property
    def parts(self) -> tuple[str, ...]:
        """The parts that learn."""
        return tuple(self.neighbours)


TASKS = {
    "arms": Task(str(Path(__file__).with_name("empty.xml")), {"left_arm": 4, "right_arm": 4}),
    "table": Task("table", {"torso": 4, "left_arm": 4, "right_arm": 4}),
    "published": Task("table", {"torso": 8, "left_arm": 16, "right_arm": 16}),
}


def space(robot: Robot, task: Task, part: str) -> Lattice:
    """Return the lattice of rank 3 of a part."""
    return Lattice(robot, JOINTS[part], neighbours=task.neighbours[part])


def offline_plant(task: Task, seed: int) -> OfflinePlant:
    """Return a plant of the whole robot, with the motors that were identified on PyBullet."""
    model = Model(load_robot(ROBOT), load_world(task.world))
    return OfflinePlant(model, seed, Gains.named(GAINS), MotorParameters.identified(ROBOT), 1.0 / RATE)


def agents(task: Task, plant: Plant, seed: int) -> list[CuriousAgent]:
    """Return an agent for each part, with the settings of services.agents."""
    return [CuriousAgent(space(plant.robot, task, part), plant, seed=seed) for part in task.parts]


def learn_offline(cell: Cell) -> dict[str, Any]:
    """Learn offline in a cell with the settings `task` and `transitions`; returns the transitions of each part, (T, 3)."""
    task, number = TASKS[cell.settings["task"]], cell.settings["transitions"]
    plant = offline_plant(task, cell.seed)
    logs = explore_together(agents(task, plant, cell.seed), plant, number)
    return {f"seen_{part}": np.array(log.seen[:number], dtype=np.int32) for part, log in logs.items()}


def learn_live(task: str, robot: str, seed: int, transitions: int, folder: Path, report: Callable[[int], None], piece: int = PIECE) -> None:
    """Let every part of a task make that many transitions on one of the ROBOTS; continues an interrupted call.

    `report`: called before each launch of `piece` transitions per part with the number that the slowest part has made.
    Raises LaunchFailed.
    """
    folder.mkdir(parents=True, exist_ok=True)
    idle = 0
    while (slowest := min((made := _made(folder, task)).values())) < transitions:
        report(slowest)
        more = min(transitions - slowest, piece)
        scenario = folder / "scenario.toml"
        # Each part makes the same number, even one that has enough: a part without work would end before the run begins.
        scenario.write_text(_scenario(task, robot, seed, {part: made[part] + more for part in made}, slowest, folder.resolve()))
        summary_of(str(scenario), ticks=round(_ACTION_TIME * RATE * more), runs=folder / "launches")
        idle = 0 if min(_made(folder, task).values()) > slowest else idle + 1
        if idle == _MAX_IDLE:
            raise LaunchFailed(f"{folder}: {_MAX_IDLE} launches in a row made no transition; see their logs in {folder / 'launches'}")


def _made(folder: Path, task: str) -> dict[str, int]:
    """Return the number of transitions of each part in the store."""
    path = folder / STORE
    if not path.exists():
        return dict.fromkeys(TASKS[task].parts, 0)
    with TransitionStore(path, "", read_only=True) as store:
        return {part: len(store.load(part)) for part in TASKS[task].parts}


def _scenario(task: str, robot: str, seed: int, goals: Mapping[str, int], slowest: int, folder: Path) -> str:
    """Return the scenario of one launch; the seed of robot and encoders differs between launches, that of the agents does not."""
    wanted = TASKS[task]
    text = _SCENARIO.format(
        robot=robot, model=ROBOT, world=wanted.world, gains=GAINS, rate=RATE, seed=1000 * seed + slowest, **ROBOTS[robot]
    )
    for part in wanted.parts:
        joints = str(list(JOINTS[part])).replace("'", '"')
        text += _AGENT.format(
            part=part, joints=joints, neighbours=wanted.neighbours[part], agent_seed=seed, folder=folder, transitions=goals[part]
        )
    return text
