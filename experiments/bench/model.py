"""The egocentric model beside MuJoCo and python-fcl: poses per second, and whether they find the same contacts.

Claim: one compiled kernel makes the model of thesis chapter 2 the fastest of its kind, on the iCub and on robots of other makers
(random_robots.py).  Ours gives every contact with depth, normal and point, and the projected forces; of MuJoCo forward kinematics and
collision detection are timed, of python-fcl whether each pair touches.  Run time: about four minutes, a quarter with `--quick`.
"""

from __future__ import annotations

import importlib.util
import inspect
import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

import numpy as np

from experiments.bench import random_robots, workload
from experiments.bench.agreement import MINIMAL, Agreement, Scene, agreements
from experiments.bench.calibration import Crew
from experiments.bench.collision_peers import FclPairs, FclTrees
from experiments.bench.mujoco_peer import MujocoPeer, load_mujoco
from experiments.bench.random_robots import MAKERS, MIXED, PLAIN
from experiments.bench.verdicts import Contestant, all_passed, judged, one_core, rates
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.model.model import Model
from mobee.robot.robot import Robot

BATCH, CALL, OBJECTS, KINEMATICS = "batch", "one call", "one call, Contact objects", "one call, kinematics only"
MUJOCO, PAIRS, TREES = "MuJoCo", "python-fcl, pair by pair", "python-fcl, trees of boxes"
ICUB = "iCub"
_VERSIONS = {"numpy": "numpy", "mujoco": "mujoco", "python-fcl": "fcl", "coal": "coal"}  # package and its module
_FCL_TESTS = 60_000  # of pairs in one round; a pose has up to 130 000
_AROUND = (0, random_robots.OBJECTS)
_THREADED = 20_000  # poses of a batch on two threads: a tenth of a second, so that the start of threads costs nothing

Rates = dict[str, Array]
"""Poses per second of each contestant in each round."""


@dataclass(frozen=True, slots=True)
class Settings:
    """How much is measured."""

    boxes: tuple[int, ...] = (0, 10, 100, 1000)
    rounds: int = 15
    poses: int = 2000
    other_poses: int = 500  # of robots of other makers
    compared_boxes: tuple[int, ...] = (0, 100)
    compared_poses: int = 500


QUICK = Settings(rounds=5, poses=500, other_poses=200, compared_poses=50)


@dataclass(frozen=True, slots=True)
class Requirement:
    """A rate of ours as a multiple of a peer's, both of the same round."""

    robot: str
    what: str
    peer: str
    objects: int
    least: float
    aim: float | None = None

    @property
    def name(self) -> str:
        """For people."""
        peer = "python-fcl" if self.peer == PAIRS else self.peer
        return f"{self.robot}, {self.what}, {self.objects}: x {peer}"


REQUIREMENTS = (
    *(Requirement(ICUB, BATCH, MUJOCO, count, 8.0, 12.0) for count in (0, 100, 1000)),
    *(Requirement(ICUB, CALL, MUJOCO, count, 5.0) for count in (0, 100)),
    *(Requirement(ICUB, BATCH, PAIRS, count, 100.0) for count in (0, 100)),
    *(
        Requirement(maker.name, what, MUJOCO, count, least)
        for maker in (MIXED, PLAIN)
        for what, least in ((BATCH, 4.0), (CALL, 2.0))
        for count in _AROUND
    ),
)
TWO_THREADS = 0.9  # of the gain that two processes have over one


def measure(settings: Settings) -> dict[str, Any]:
    """Everything that `mobee bench model --json` prints; raises MujocoMissing."""
    load_mujoco()
    robot, with_coal = workload.robot(), importlib.util.find_spec("pinocchio") is not None
    measured: dict[str, dict[int, Rates]] = {name: {} for name in (ICUB, *(maker.name for maker in MAKERS))}
    scenes = [_scene(ICUB, count, settings.compared_poses) for count in settings.compared_boxes]
    scenes += [_scene(maker.name, count, settings.compared_poses) for maker in MAKERS for count in _AROUND]
    with Progress() as progress:
        with one_core() as core:
            for done, boxes in enumerate(settings.boxes):
                progress.show(0.5 * done / len(settings.boxes), f"timing among {boxes} boxes")
                measured[ICUB][boxes] = rates(contestants(robot, boxes, settings.poses), settings.rounds)
            for done, (maker, count) in enumerate(itertools.product(MAKERS, _AROUND)):
                progress.show(0.5 + 0.2 * done / 6.0, f"timing {maker.name}")
                measured[maker.name][count] = rates(beside_mujoco(_scene(maker.name, count, settings.other_poses)), settings.rounds)
        threads = _on_two_threads(_scene(ICUB, 0, settings.poses), settings.rounds)
        compared: list[Agreement] = []
        off = 0.0
        for done, scene in enumerate(scenes):
            progress.show(0.7 + 0.3 * done / len(scenes), f"comparing contacts of {scene.name}")
            found, farthest = agreements(scene, with_coal)
            compared += found
            off = max(off, farthest)
    return {
        "workload": _about(robot, settings),
        "core": core,
        "versions": {name: metadata.version(name) for name in _VERSIONS if importlib.util.find_spec(_VERSIONS[name])},
        "coal": with_coal,
        **summed_up(measured, threads, off, compared),
    }


def summed_up(
    measured: Mapping[str, Mapping[int, Rates]], threads: Mapping[str, float] | None, off: float, compared: Sequence[Agreement]
) -> dict[str, Any]:
    """Medians of the rates and of the ratios to the peers, the iCub's, and under "others" those of other makers; and the verdict.

    `threads`: what two threads gain, and what two processes do; `off`: see `agreements`.
    """

    def tables(found: Mapping[int, Rates]) -> dict[str, Any]:
        return {
            "poses_per_second": {count: {name: float(np.median(of)) for name, of in one.items()} for count, one in found.items()},
            **{
                key: {count: {name: _ratio(one, name, peer) for name in one} for count, one in found.items() if peer in one}
                for key, peer in (("times_mujoco", MUJOCO), ("times_python_fcl", PAIRS))
            },
        }

    others = {name: tables(found) for name, found in measured.items() if name != ICUB}
    about = {"others": others, "threads": threads, "agreement": [asdict(one) for one in compared]}
    return {**tables(measured[ICUB]), **about, **_verdict(measured, threads, off, all(one.passed for one in compared))}


def _verdict(measured: Mapping[str, Mapping[int, Rates]], threads: Mapping[str, float] | None, off: float, agree: bool) -> dict[str, Any]:
    """Whether we are as fast beside the peers as required, and find the same contacts with right depths."""
    required = [
        judged(one.name, _ratio(measured[one.robot][one.objects], one.what, one.peer), at_least=one.least, aim=one.aim)
        for one in REQUIREMENTS
        if one.objects in measured[one.robot]
    ]
    if threads is not None:
        required.append(judged("2 threads' gain over 2 processes'", threads["gain"] / threads["processes"], at_least=TWO_THREADS))
    required.append(judged("depths off the way out, m", off, at_most=MINIMAL))
    return {"requirements": required, "passed": all_passed(required) and agree}


def contestants(robot: Robot, boxes: int, poses: int) -> dict[str, Contestant]:
    """All that is timed on the iCub, in the same world and the same poses."""
    scene = Scene(ICUB, robot, workload.world(boxes), workload.poses(poses))
    model, rows = Model(robot, scene.world), list(scene.q)
    pairs, trees = FclPairs(robot, scene.world.snapshot), FclTrees(robot, scene.world.snapshot)

    def call_objects() -> None:
        for row in rows:
            pose = model.evaluate(row)
            _ = pose.contacts, pose.projection

    def kinematics() -> None:
        for row in rows:
            _ = model.evaluate(row).transforms

    few, some = max(1, _FCL_TESTS // len(pairs)), max(20, poses // 50)
    first = beside_mujoco(scene)
    return {
        BATCH: first[BATCH],
        CALL: first[CALL],
        OBJECTS: Contestant(call_objects, poses),
        KINEMATICS: Contestant(kinematics, poses),
        MUJOCO: first[MUJOCO],
        PAIRS: Contestant(_in_turn(model, scene.q, pairs.detect, few), few),
        TREES: Contestant(_in_turn(model, scene.q, trees.detect, some), some),
    }


def beside_mujoco(scene: Scene) -> dict[str, Contestant]:
    """Ours, in a batch and one by one, and MuJoCo."""
    model, rows, poses = Model(scene.robot, scene.world), list(scene.q), len(scene.q)
    mujoco = MujocoPeer(scene.robot, scene.world.objects)
    angles = list(mujoco.joint_angles(scene.q))

    def batch() -> None:
        pose = model.evaluate(scene.q)
        _ = pose.table, pose.projection

    def call() -> None:
        for row in rows:
            pose = model.evaluate(row)
            _ = pose.table, pose.projection

    def detect() -> None:
        for row in angles:
            mujoco.detect(row)

    return {BATCH: Contestant(batch, poses), CALL: Contestant(call, poses), MUJOCO: Contestant(detect, poses)}


def _scene(robot: str, objects: int, poses: int) -> Scene:
    if robot == ICUB:
        return Scene(ICUB, workload.robot(), workload.world(objects), workload.poses(poses))
    maker = {one.name: one for one in MAKERS}[robot]
    return Scene(robot, random_robots.robot(maker), random_robots.world(maker, objects), random_robots.poses(maker, poses))


def _on_two_threads(scene: Scene, rounds: int) -> dict[str, float] | None:
    """Wall time of a batch on one thread over that on two, and what two processes gain here; None: there are no threads.

    The best of the rounds counts: where others use the cores, most of them tell how these are shared and not what threads gain.
    """
    if "threads" not in inspect.signature(Model.evaluate).parameters:
        return None
    model, q = Model(scene.robot, scene.world), np.resize(scene.q, (_THREADED, scene.q.shape[1]))

    def seconds(threads: int) -> float:
        start = time.perf_counter()
        pose = model.evaluate(q, threads=threads)
        _ = pose.table, pose.projection
        return time.perf_counter() - start

    with Crew(1) as one, Crew(2) as two:
        found = np.array([(seconds(1), seconds(2), 1.0 / one.loops(), 0.5 / two.loops()) for _ in range(rounds)]).min(axis=0)
    return {"gain": float(found[0] / found[1]), "processes": float(found[2] / found[3])}


def _in_turn(model: Model, q: Array, detect: Callable[[Array], object], count: int) -> Callable[[], None]:
    """Detect in `count` poses, the next time in the next ones; forward kinematics are ours, the fastest there are."""
    poses = itertools.cycle(q)

    def run() -> None:
        for row in itertools.islice(poses, count):
            detect(model.evaluate(row).transforms)

    return run


def _ratio(found: Rates, name: str, peer: str) -> float:
    return float(np.median(found[name] / found[peer]))


def _about(robot: Robot, settings: Settings) -> dict[str, int]:
    return {
        "motors": len(robot.motors),
        "joints": len(robot.joints),
        "primitives": len(robot.shapes),
        "pairs": len(robot.field_pairs) + len(robot.solid_pairs),
        "poses": settings.poses,
        "rounds": settings.rounds,
    }
