"""The egocentric model beside MuJoCo and python-fcl: poses per second, and whether they find the same contacts.

Claim: one compiled kernel makes the model of thesis chapter 2 the fastest of its kind.  Ours gives every contact with depth,
normal and point, and the projected forces; of MuJoCo forward kinematics and collision detection are timed, of python-fcl
whether each pair touches.  Run time: about two minutes, a quarter with `--quick`.
"""

from __future__ import annotations

import importlib.util
import itertools
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

import numpy as np

from experiments.bench import workload
from experiments.bench.agreement import agreements
from experiments.bench.fcl_peers import FclPairs, FclTrees
from experiments.bench.mujoco_peer import MujocoPeer
from experiments.bench.rounds import Contestant, one_core, rates
from experiments.progress import Progress
from mobee.model import Model
from mobee.robot.robot import Array, Robot

BATCH, CALL, OBJECTS, KINEMATICS = "batch", "one call", "one call, Contact objects", "one call, kinematics only"
MUJOCO, PAIRS, TREES = "MuJoCo", "python-fcl, pair by pair", "python-fcl, trees of boxes"
_VERSIONS = {"numba": "numba", "numpy": "numpy", "mujoco": "mujoco", "python-fcl": "fcl", "coal": "coal"}  # package and its module
_FCL_TESTS = 60_000  # of pairs in one round; a pose has up to 130 000


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured."""

    boxes: tuple[int, ...] = (0, 10, 100, 1000)
    rounds: int = 15
    poses: int = 2000
    compared_boxes: tuple[int, ...] = (0, 100)
    compared_poses: int = 500


QUICK = Settings(rounds=5, poses=500, compared_poses=50)


@dataclass(frozen=True, slots=True)
class Requirement:
    """A rate of ours as a multiple of a peer's, both of the same round."""

    name: str
    peer: str
    boxes: int
    least: float
    aim: float | None = None


REQUIREMENTS = (
    Requirement(BATCH, MUJOCO, 0, 2.2, 6.0),
    Requirement(BATCH, MUJOCO, 100, 3.5, 8.0),
    Requirement(CALL, MUJOCO, 0, 1.7),
    Requirement(BATCH, PAIRS, 0, 100.0),
    Requirement(BATCH, PAIRS, 100, 100.0),
)


def measure(settings: Settings) -> dict[str, Any]:
    """Everything that `mobee bench model --json` prints; raises MujocoMissing."""
    robot, with_coal = workload.robot(), importlib.util.find_spec("pinocchio") is not None
    measured: dict[int, dict[str, Array]] = {}
    with Progress() as progress:
        with one_core() as core:
            for done, boxes in enumerate(settings.boxes):
                progress.show(0.7 * done / len(settings.boxes), f"timing among {boxes} boxes")
                measured[boxes] = rates(contestants(robot, boxes, settings.poses), settings.rounds)
        compared = []
        for done, boxes in enumerate(settings.compared_boxes):
            progress.show(0.7 + 0.3 * done / len(settings.compared_boxes), f"comparing contacts among {boxes} boxes")
            compared += agreements(boxes, settings.compared_poses, with_coal)
    return {
        "workload": _about(robot, settings),
        "core": core,
        "versions": {name: metadata.version(name) for name in _VERSIONS if importlib.util.find_spec(_VERSIONS[name])},
        "poses_per_second": {
            boxes: {name: float(np.median(values)) for name, values in found.items()} for boxes, found in measured.items()
        },
        "times_mujoco": {boxes: {name: _ratio(found, name, MUJOCO) for name in found} for boxes, found in measured.items()},
        "times_python_fcl": {boxes: {name: _ratio(found, name, PAIRS) for name in found} for boxes, found in measured.items()},
        "requirements": [_judged(one, measured[one.boxes]) for one in REQUIREMENTS if one.boxes in measured],
        "agreement": [asdict(one) for one in compared],
        "coal": with_coal,
    }


def contestants(robot: Robot, boxes: int, poses: int) -> dict[str, Contestant]:
    """All that is timed, in the same world and the same poses."""
    world, q = workload.world(boxes), workload.poses(poses)
    model, rows = Model(robot, world), list(q)
    mujoco = MujocoPeer(robot, world.objects)
    angles = list(mujoco.joint_angles(q))
    pairs, trees = FclPairs(robot, world.snapshot), FclTrees(robot, world.snapshot)

    def batch() -> None:
        pose = model.evaluate(q)
        _ = pose.table, pose.projection

    def call() -> None:
        for row in rows:
            pose = model.evaluate(row)
            _ = pose.table, pose.projection

    def call_objects() -> None:
        for row in rows:
            pose = model.evaluate(row)
            _ = pose.contacts, pose.projection

    def kinematics() -> None:
        for row in rows:
            _ = model.evaluate(row).transforms

    def detect() -> None:
        for row in angles:
            mujoco.detect(row)

    few, some = max(1, _FCL_TESTS // len(pairs)), max(20, poses // 50)
    return {
        BATCH: Contestant(batch, poses),
        CALL: Contestant(call, poses),
        OBJECTS: Contestant(call_objects, poses),
        KINEMATICS: Contestant(kinematics, poses),
        MUJOCO: Contestant(detect, poses),
        PAIRS: Contestant(_in_turn(model, q, pairs.detect, few), few),
        TREES: Contestant(_in_turn(model, q, trees.detect, some), some),
    }


def _in_turn(model: Model, q: Array, detect: Callable[[Array], object], count: int) -> Callable[[], None]:
    """Detect in `count` poses, the next time in the next ones; forward kinematics are ours, the fastest there are."""
    poses = itertools.cycle(q)

    def run() -> None:
        for row in itertools.islice(poses, count):
            detect(model.evaluate(row).transforms)

    return run


def _ratio(found: dict[str, Array], name: str, peer: str) -> float:
    return float(np.median(found[name] / found[peer]))


def _judged(one: Requirement, found: dict[str, Array]) -> dict[str, Any]:
    ratio = _ratio(found, one.name, one.peer)
    return {**asdict(one), "ratio": ratio, "passed": ratio >= one.least}


def _about(robot: Robot, settings: Settings) -> dict[str, int]:
    return {
        "motors": len(robot.motors),
        "joints": len(robot.joints),
        "primitives": len(robot.shapes),
        "pairs": len(robot.field_pairs) + len(robot.solid_pairs),
        "poses": settings.poses,
        "rounds": settings.rounds,
    }
