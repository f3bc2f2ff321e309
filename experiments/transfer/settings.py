"""What is the same offline and live."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from mobee import CuriousAgent, Gains, Lattice, Model, MotorParameters, OfflinePlant, load_robot, load_world
from mobee.plant import Plant
from mobee.robot.robot import Robot
from mobee.store import TransitionStore

ROBOT, GAINS, RATE = "icub", "published_2014", 50  # of the robot that PyBullet simulates; Hz
JOINTS = {
    "torso": ("torso_yaw", "torso_roll", "torso_pitch"),
    "left_arm": ("l_shoulder_pitch", "l_shoulder_roll", "l_shoulder_yaw", "l_elbow"),
    "right_arm": ("r_shoulder_pitch", "r_shoulder_roll", "r_shoulder_yaw", "r_elbow"),
}


@dataclass(frozen=True, slots=True)
class Task:
    """Which parts learn, in which world, with how many actions a state."""

    world: str
    neighbours: Mapping[str, int]

    @property
    def parts(self) -> tuple[str, ...]:
        """Those that learn."""
        return tuple(self.neighbours)


TASKS = {
    "arms": Task(str(Path(__file__).with_name("empty.xml")), {"left_arm": 4, "right_arm": 4}),
    "table": Task("table", {"torso": 4, "left_arm": 4, "right_arm": 4}),
    "published": Task("table", {"torso": 8, "left_arm": 16, "right_arm": 16}),
}


def space(robot: Robot, task: Task, part: str) -> Lattice:
    """The lattice of rank 3 of a part."""
    return Lattice(robot, JOINTS[part], neighbours=task.neighbours[part])


def offline_plant(task: Task, seed: int) -> OfflinePlant:
    """The whole robot, with the motors that were identified on PyBullet."""
    model = Model(load_robot(ROBOT), load_world(task.world))
    return OfflinePlant(model, seed, Gains.named(GAINS), MotorParameters.identified(ROBOT), 1.0 / RATE)


def agents(task: Task, plant: Plant, seed: int, store: Path | None = None) -> list[CuriousAgent]:
    """One a part, as services.agents makes them."""
    return [
        CuriousAgent(space(plant.robot, task, part), plant, seed=seed, store=None if store is None else TransitionStore(store, part))
        for part in task.parts
    ]
