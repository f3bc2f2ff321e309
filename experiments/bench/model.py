# SPDX-License-Identifier: Apache-2.0
"""The egocentric model (link poses and contacts of the robot) compared with MuJoCo and python-fcl: speed, and agreement of contacts.

Claim: one compiled kernel makes the model of thesis chapter 2 the fastest of its kind, on the iCub and on robots of other makers
(scenes.py).  Our model computes every contact with depth, normal and point, and the projection of the contacts to the motors (the sum in
thesis eq. 5.11).  MuJoCo is timed while it computes forward kinematics and detects collisions, python-fcl while it computes whether each
pair touches.  Run time: about four minutes, a quarter with `--quick`.
"""

from __future__ import annotations

import importlib.util
import inspect
import itertools
import textwrap
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from importlib import metadata
from typing import Any

import numpy as np

from experiments.bench.agreement import DEPTH_TOLERANCE, MIN_OVERLAP, Agreement, agreements
from experiments.bench.peers import MujocoPeer, load_mujoco
from experiments.bench.scenes import ICUB, MAKERS, MIXED, OBJECTS, PLAIN, Scene, boxes_world, upper_body, upper_body_poses, upper_body_scene
from experiments.bench.timing import Contestant, Crew, cores_text, one_core, rates
from experiments.bench.verdicts import Requirement, requirement_lines, verdict
from experiments.kit.command_line import Progress
from mobee.arrays import Array
from mobee.model.model import Model
from mobee.robot.robot import Robot

BATCH, CALL, CALL_OBJECTS, KINEMATICS = "batch", "one call", "one call, Contact objects", "one call, kinematics only"
MUJOCO, PAIRS, TREES = "MuJoCo", "python-fcl, pair by pair", "python-fcl, trees of boxes"
_VERSIONS = {"numpy": "numpy", "mujoco": "mujoco", "python-fcl": "fcl", "coal": "coal"}  # package and its module
_FCL_PAIRS = 60_000  # tested in one round; a pose has up to 130 000
_OBJECT_COUNTS = (0, OBJECTS)  # around robots of other makers
_POSES_OF_THREADS = 20_000  # of a batch on two threads: a tenth of a second, so that the start of threads costs nothing

_PEERS = (MUJOCO, PAIRS, TREES)
_WIDTH = 80
_NOTE = (
    f"differ: pairs that touch for one of the two only, and how deep the deepest is (less than {MIN_OVERLAP:g} m is no difference); "
    f"same depths: within {DEPTH_TOLERANCE:g} m of the peer's, which need not be minimal; "
    "longer: our depth than the separation along the peer's normal, at most [m]"
)

Rates = dict[str, Array]
"""Poses per second of processor time in each round, shape (rounds,), by the name of the contestant."""


@dataclass(frozen=True, slots=True)
class Settings:
    """Sizes and repetitions of the measurements.

    `boxes`: how many boxes are around the iCub; each number is measured.  `rounds`: repetitions.  `poses`: poses in a round.
    `other_poses`: the same for robots of other makers.  `compared_boxes` and `compared_poses`: numbers of boxes, and poses, for the
    comparison of the contacts.
    """

    boxes: tuple[int, ...] = (0, 10, 100, 1000)
    rounds: int = 15
    poses: int = 2000
    other_poses: int = 500  # of robots of other makers
    compared_boxes: tuple[int, ...] = (0, 100)
    compared_poses: int = 500


QUICK = Settings(rounds=5, poses=500, other_poses=200, compared_poses=50)


def _ratio_requirement(robot: str, ours: str, objects: int, at_least: float, aim: float | None = None, peer: str = "mujoco") -> Requirement:
    """Return a bound on a rate of ours as a multiple of a peer's, both of the same round."""
    shown = "MuJoCo" if peer == "mujoco" else "python-fcl"
    table = () if robot == ICUB else ("others", robot)
    return Requirement(f"{robot}, {ours}, {objects}: x {shown}", (*table, f"times_{peer}", objects, ours), at_least, aim=aim)


REQUIREMENTS = (
    *(_ratio_requirement(ICUB, BATCH, count, 8.0, 12.0) for count in (0, 100, 1000)),
    *(_ratio_requirement(ICUB, CALL, count, 5.0) for count in (0, 100)),
    *(_ratio_requirement(ICUB, BATCH, count, 100.0, peer="python_fcl") for count in (0, 100)),
    *(
        _ratio_requirement(maker.name, ours, count, least)
        for maker in (MIXED, PLAIN)
        for ours, least in ((BATCH, 4.0), (CALL, 2.0))
        for count in _OBJECT_COUNTS
    ),
    Requirement("2 threads' gain over 2 processes'", ("share_of_processes",), at_least=0.9),
    Requirement("depth errors along the normal, m", ("depth_error",), at_most=DEPTH_TOLERANCE),
)


def measure(settings: Settings) -> dict[str, Any]:
    """Run this benchmark and return its result; raises NotInstalled without MuJoCo or python-fcl.

    Main keys: "workload", and "versions", a dict from a program to its version; "poses_per_second", "times_mujoco" and "times_python_fcl",
    rates of the iCub's model and their ratios to the peers' rates, as dicts; "agreement", a list with the fields of each `Agreement`
    (comparison of contacts) as a dict; "requirements" and "passed".  `summarized` explains all keys from "poses_per_second" on.
    """
    load_mujoco()
    robot, with_coal = upper_body(), importlib.util.find_spec("pinocchio") is not None
    counts = sorted(set(settings.boxes))
    measured: dict[str, dict[int, Rates]] = {name: {} for name in (ICUB, *(maker.name for maker in MAKERS))}
    scenes = [upper_body_scene(count, settings.compared_poses) for count in settings.compared_boxes if count in counts]
    scenes += [maker.scene(count, settings.compared_poses) for maker in MAKERS for count in _OBJECT_COUNTS]
    with Progress() as progress:
        with one_core() as core:
            for done, boxes in enumerate(counts):
                progress.show(0.5 * done / len(counts), f"timing among {boxes} boxes")
                measured[ICUB][boxes] = rates(contestants(robot, boxes, settings.poses), settings.rounds)
            for done, (maker, count) in enumerate(itertools.product(MAKERS, _OBJECT_COUNTS)):
                progress.show(0.5 + 0.2 * done / 6.0, f"timing {maker.name}")
                measured[maker.name][count] = rates(beside_mujoco(maker.scene(count, settings.other_poses)), settings.rounds)
        threads = _on_two_threads(upper_body_scene(0, settings.poses), settings.rounds)
        compared: list[Agreement] = []
        depth_error = 0.0
        for done, scene in enumerate(scenes):
            progress.show(0.7 + 0.3 * done / len(scenes), f"comparing contacts of {scene.name}")
            found, error = agreements(scene, with_coal)
            compared += found
            depth_error = max(depth_error, error)
    return {
        "workload": _workload(robot, settings),
        "core": core,
        "versions": {name: metadata.version(name) for name in _VERSIONS if importlib.util.find_spec(_VERSIONS[name])},
        "coal": with_coal,
        **summarized(measured, threads, depth_error, compared),
    }


def summarized(
    measured: Mapping[str, Mapping[int, Rates]], threads: Mapping[str, float] | None, depth_error: float, compared: Sequence[Agreement]
) -> dict[str, Any]:
    """Return the medians of the rates and of their ratios to the peers' rates, and the verdict.

    `measured`: the rates of all contestants, by the name of the robot and the number of objects around it.  `threads`: a dict with "gain",
    wall time of a batch on one thread divided by that on two threads, and "processes", work per second of two processes divided by that of
    one process; None if this was not measured.  `depth_error`: the model's largest depth error [m].  `compared`: the comparisons of
    contacts with the peers.

    Keys: "poses_per_second", "times_mujoco" and "times_python_fcl", for the iCub: each a dict from the number of objects to a dict from the
    contestant to the rate or ratio; "others", the same tables for each other robot; "requirements", a list with the dict that
    `Requirement.judge` returns for each requirement; "passed", whether all are met and all comparisons have passed; "threads" and
    "depth_error", the arguments; "agreement", the argument `compared` as a list of dicts.
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
    result = {**tables(measured[ICUB]), "others": others, "threads": threads, "agreement": [asdict(one) for one in compared]}
    result["depth_error"] = depth_error
    if threads is not None:
        result["share_of_processes"] = threads["gain"] / threads["processes"]
    judged = verdict(result, [one for one in REQUIREMENTS if one.is_measured(result)])
    return result | judged | {"passed": judged["passed"] and all(one.passed for one in compared)}


def contestants(robot: Robot, boxes: int, poses: int) -> dict[str, Contestant]:
    """Return the programs to compare (ours, MuJoCo, python-fcl), by name; all have the same robot, world and poses.

    `boxes`: number of boxes in the world.  `poses`: number of poses in a run of our model and in a run of MuJoCo; a run of python-fcl has
    fewer.
    """
    from experiments.bench.collision_peers import FclPairs, FclTrees  # raises NotInstalled without python-fcl

    scene = Scene(ICUB, robot, boxes_world(boxes), upper_body_poses(poses))
    model, rows = Model(robot, scene.world), list(scene.q)
    pairs, trees = FclPairs(robot, scene.world.snapshot), FclTrees(robot, scene.world.snapshot)

    def call_objects() -> None:
        for row in rows:
            pose = model.evaluate(row)
            _ = pose.contacts, pose.projection

    def kinematics() -> None:
        for row in rows:
            _ = model.evaluate(row).transforms

    few, some = max(1, _FCL_PAIRS // len(pairs)), max(20, poses // 50)
    first = beside_mujoco(scene)
    return {
        BATCH: first[BATCH],
        CALL: first[CALL],
        CALL_OBJECTS: Contestant(call_objects, poses),
        KINEMATICS: Contestant(kinematics, poses),
        MUJOCO: first[MUJOCO],
        PAIRS: Contestant(_in_turn(model, scene.q, pairs.detect, few), few),
        TREES: Contestant(_in_turn(model, scene.q, trees.detect, some), some),
    }


def beside_mujoco(scene: Scene) -> dict[str, Contestant]:
    """Return three programs on a scene: our model with all poses in one batch (BATCH) and pose by pose (CALL), and MuJoCo (MUJOCO)."""
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


def _on_two_threads(scene: Scene, rounds: int) -> dict[str, float] | None:
    """Return how much faster a batch of poses is on two threads than on one; None if the model has no argument `threads`.

    Keys: "gain", wall time on one thread divided by that on two; "processes", work per second of two processes divided by that of one,
    which shows what two cores of this machine can gain at most.  Each time is the shortest of the `rounds`: while other programs use the
    cores, most rounds measure how these are shared.
    """
    if "threads" not in inspect.signature(Model.evaluate).parameters:
        return None
    model, q = Model(scene.robot, scene.world), np.resize(scene.q, (_POSES_OF_THREADS, scene.q.shape[1]))

    def seconds(threads: int) -> float:
        start = time.perf_counter()
        pose = model.evaluate(q, threads=threads)
        _ = pose.table, pose.projection
        return time.perf_counter() - start

    with Crew(1) as one, Crew(2) as two:
        found = np.array([(seconds(1), seconds(2), 1.0 / one.loops(), 0.5 / two.loops()) for _ in range(rounds)]).min(axis=0)
    return {"gain": float(found[0] / found[1]), "processes": float(found[2] / found[3])}


def _in_turn(model: Model, q: Array, detect: Callable[[Array], object], count: int) -> Callable[[], None]:
    """Return a function that calls `detect` for the next `count` of the poses `q` (B, n) rad, and begins again after the last one.

    `detect` gets the poses of the links, (L, 4, 4), which MoBeE's model computes.
    """
    poses = itertools.cycle(q)

    def run() -> None:
        for row in itertools.islice(poses, count):
            detect(model.evaluate(row).transforms)

    return run


def _ratio(found: Rates, name: str, peer: str) -> float:
    return float(np.median(found[name] / found[peer]))


def _workload(robot: Robot, settings: Settings) -> dict[str, int]:
    return {
        "motors": len(robot.motors),
        "joints": len(robot.joints),
        "primitives": len(robot.shapes),
        "pairs": len(robot.field_pairs) + len(robot.solid_pairs),
        "poses": settings.poses,
        "rounds": settings.rounds,
    }


def report(result: dict[str, Any]) -> str:
    """Return the result of `measure` as text: tables of rates, ratios and comparisons of contacts, then the requirements."""
    about = result["workload"]
    head = _wrapped(
        f"{about['motors']} motors, {about['joints']} joints, {about['primitives']} primitives, {about['pairs']} tested pairs; N boxes. "
        f"Processor time {cores_text(result['core'])}, medians of {about['rounds']} rounds: "
        "ratios can be compared, rates only within one run."
    )
    required = "\n".join(["required", *requirement_lines(result["requirements"])])
    return "\n\n".join([head, *_tables(result), _others(result), required, *([_agreement(result)] if result["agreement"] else [])])


def _tables(result: dict[str, Any]) -> list[str]:
    rates = result["poses_per_second"]
    rows = {name: [_thousands(found[name]) for found in rates.values()] for name in next(iter(rates.values()))}
    tables = [_table("poses per second", rates, rows)]
    for key, title in (("times_mujoco", "times MuJoCo"), ("times_python_fcl", "times python-fcl, pair by pair")):
        ours = [name for name in rows if name not in _PEERS and name != KINEMATICS]
        tables.append(_table(title, rates, {name: [f"{found[name]:.1f}" for found in result[key].values()] for name in ours}))
    return tables


def _table(title: str, boxes: dict[int, Any], rows: dict[str, list[str]]) -> str:
    lines = [f"{title:<34}" + "".join(f"{f'N = {count}':>11}" for count in boxes)]
    for name, cells in rows.items():
        lines.append(f"  {name if name in _PEERS else f'ours, {name}':<32}" + "".join(f"{cell:>11}" for cell in cells))
    return "\n".join(lines)


def _others(result: dict[str, Any]) -> str:
    """Format the rates of robots of other makers, and of threads."""
    lines = ["robots of other makers                poses per second          times MuJoCo"]
    lines.append(f"  {'N':>20}{'batch':>12}{'one call':>10}{'MuJoCo':>10}{'batch':>12}{'one call':>10}")
    for name, found in result["others"].items():
        for count, speeds in found["poses_per_second"].items():
            ratios = found["times_mujoco"][count]
            lines.append(
                f"  {name:<16}{count:>4}{_thousands(speeds[BATCH]):>12}{_thousands(speeds[CALL]):>10}{_thousands(speeds[MUJOCO]):>10}"
                f"{ratios[BATCH]:>12.2f}{ratios[CALL]:>10.2f}"
            )
    threads = result["threads"]
    if threads is not None:
        lines.append(f"  a batch on 2 threads: {threads['gain']:.2f} x one; 2 processes at once: {threads['processes']:.2f} x one")
    return "\n".join(lines)


def _agreement(result: dict[str, Any]) -> str:
    lines = [f"{'agreement':<18}{'N':>4}{'':<12}{'contacts':>8}{'differ':>10}{'same depths':>12}{'longer':>8}"]
    for one in result["agreement"]:
        differing = f"{one['other_pairs']}" + (f", {one['deepest_other']:.0e}" if one["other_pairs"] else "")
        lines.append(
            f"  {one['scene']:<16}{one['objects']:>4}  {one['peer']:<10}{one['contacts']:>8}{differing:>10}"
            f"{100.0 * one['same_depths']:>10.1f} %{one['beaten']:>8.0e}{'' if one['passed'] else ' DIFFERS'}"
        )
    if not result["coal"]:
        lines.append('  coal: not installed: pip install "mobee[dev]"')
    return "\n".join([*lines, _wrapped(_NOTE, "  ")])


def _wrapped(text: str, indent: str = "") -> str:
    return textwrap.fill(text, _WIDTH, initial_indent=indent, subsequent_indent=indent)


def _thousands(rate: float) -> str:
    return f"{rate:,.0f}".replace(",", " ")
