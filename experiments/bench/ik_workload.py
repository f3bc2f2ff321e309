"""What inverse kinematics is measured on: palm poses of random postures among boxes, all of them reachable without a contact."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import mobee
from experiments.bench import workload
from mobee.arrays import Array
from mobee.roadmap.ik.term import Term

MARKER = "right_palm"
_ARM = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
MOTORS = ("torso", *(f"r_{name}" for name in _ARM))
BOXES = 100
AT_ONCE = 500


@dataclass(frozen=True, slots=True, eq=False)
class Target:
    """A pose of the palm: a place (3,) m and a rotation (3, 3), and how near it is to be come."""

    place: Array
    rotation: Array
    metres: float = 0.005
    radians: float = float(np.deg2rad(5.0))

    def costs(self) -> list[Term]:
        """To be there within the tolerances, without a contact, near home."""
        costs = mobee.costs
        return [
            costs.position(MARKER, self.place, self.metres),
            costs.orientation(MARKER, self.rotation, self.radians),
            costs.collision(),
            costs.home(),
        ]


def scene() -> mobee.Model:
    """The iCub among the first boxes of the model's benchmark that do not touch it at home."""
    robot, world = mobee.load_robot("icub"), mobee.World()
    model = mobee.Model(robot, world)
    candidates = workload.world(1000).snapshot.objects
    free = 0
    for name, thing in candidates.items():
        world.add(name, mobee.box(*thing.size), position=thing.position, rotation=thing.rotation)
        if model.evaluate(robot.home).count:
            world.remove(name)
            continue
        free += 1
        if free == BOXES:
            return model
    raise ValueError(f"only {free} boxes do not touch the robot at home, {BOXES} are needed")


def targets(model: mobee.Model, count: int, seed: int = 0) -> list[Target]:
    """The palm's poses in random postures of torso and arm that touch nothing."""
    robot, rng = model.robot, np.random.default_rng(seed)
    columns = [*range(robot.part("torso").start, len(robot.part("torso"))), *(robot.motor_index(name) for name in MOTORS[1:])]
    found: list[Target] = []
    while len(found) < count:
        q = np.repeat(robot.home[None], AT_ONCE, axis=0)
        q[:, columns] = rng.uniform(*robot.limits[columns].T, (AT_ONCE, len(columns)))
        pose = model.evaluate(q)
        places, rotations = pose.position(MARKER), pose.rotation(MARKER)
        found += [Target(places[k], rotations[k]) for k in np.flatnonzero(np.asarray(pose.count) == 0)]
    return found[:count]
