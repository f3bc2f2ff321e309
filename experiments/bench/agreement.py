"""Whether the model and its peers find the same contacts, and how far their depths differ."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from experiments.bench import workload
from experiments.bench.coal_peer import CoalPeer
from experiments.bench.mujoco_peer import MujocoPeer
from mobee.collision.contact import ContactTable
from mobee.collision.world import World
from mobee.model import Model
from mobee.robot.robot import Array, Ints, Robot

GRAZE = 1e-6  # m; of a pair that overlaps by less, two right programs may differ on whether it touches
_EXACT = {"coal": 1e-6, "python-fcl": 2e-6}  # m; how far the depths may differ; fcl's own tolerance is 1e-6

# Detection in one pose: pairs (c, 2) of volumes, depths (c,) m.
Detect = Callable[[int], tuple[Ints, Array]]


@dataclass(frozen=True, slots=True)
class Agreement:
    """The model beside one peer, over all poses."""

    peer: str
    boxes: int
    poses: int
    contacts: int
    other_pairs: int  # found by one of the two only
    deepest_other: float  # m, depth of the deepest such pair
    depth_difference: dict[str, float]  # m, greatest by kinds, "box-capsule"
    passed: bool


def agreements(boxes: int, poses: int, with_coal: bool) -> list[Agreement]:
    """The model beside MuJoCo, python-fcl and, if it is there, coal, at random poses among that many boxes."""
    robot, world, q = workload.robot(), workload.world(boxes), workload.poses(poses)
    ours = Model(robot, world).evaluate(q).table
    peers = {"MuJoCo": _mujoco(robot, world, q), "python-fcl": _fcl(robot, world, q)}
    if with_coal:
        peers["coal"] = _coal(robot, world, q)
    kinds = [volume.kind for volume in (*robot.shapes, *world.objects.values())]
    return [_compare(name, boxes, ours, detect, kinds, poses) for name, detect in peers.items()]


def _compare(peer: str, boxes: int, ours: ContactTable, detect: Detect, kinds: list[str], poses: int) -> Agreement:
    other: list[float] = []
    difference: dict[str, float] = defaultdict(float)
    for pose, mine in enumerate(_by_pose(ours, poses)):
        pairs, depths = detect(pose)
        theirs = dict(zip(map(tuple, pairs.tolist()), depths.tolist(), strict=True))
        other += [(mine | theirs)[pair] for pair in mine.keys() ^ theirs.keys()]
        for pair in mine.keys() & theirs.keys():
            names = "-".join(sorted(kinds[index] for index in pair))
            difference[names] = max(difference[names], abs(mine[pair] - theirs[pair]))
    deepest = max(other, default=0.0)
    same_depths = peer not in _EXACT or max(difference.values(), default=0.0) <= _EXACT[peer]
    return Agreement(peer, boxes, poses, len(ours), len(other), deepest, dict(sorted(difference.items())), deepest < GRAZE and same_depths)


def _by_pose(table: ContactTable, poses: int) -> list[dict[tuple[int, int], float]]:
    found: list[dict[tuple[int, int], float]] = [{} for _ in range(poses)]
    for pose, first, second, depth in zip(*(getattr(table, what).tolist() for what in ("pose", "first", "second", "depth")), strict=True):
        found[pose][first, second] = depth
    return found


def _mujoco(robot: Robot, world: World, q: Array) -> Detect:
    peer = MujocoPeer(robot, world.objects)
    angles = peer.joint_angles(q)

    def detect(pose: int) -> tuple[Ints, Array]:
        peer.detect(angles[pose])
        return peer.touching()

    return detect


def _fcl(robot: Robot, world: World, q: Array) -> Detect:
    model = Model(robot, world, engine="fcl")

    def detect(pose: int) -> tuple[Ints, Array]:
        table = model.evaluate(q[pose]).table
        return np.stack([table.first, table.second], axis=1), table.depth

    return detect


def _coal(robot: Robot, world: World, q: Array) -> Detect:
    peer = CoalPeer(robot, world.snapshot)
    return lambda pose: peer.touching(q[pose])[:2]
