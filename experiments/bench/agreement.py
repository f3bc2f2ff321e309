"""Whether the model and its peers find the same contacts, whether depths are right and minimal, and how far the peers' differ.

Two programs may differ on whether a pair touches that overlaps by less than GRAZE.  A depth is right if it is the way out along its
normal, and minimal if no peer knows a direction in which the way is shorter; `way_out` is the judge of both, so that a peer whose own
depths are not minimal (MuJoCo's points of contact, the iterative searches of coal and fcl where cylinders meet) judges all the same.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from experiments.bench.collision_peers import CoalPeer, Volume, way_out
from experiments.bench.mujoco_peer import MujocoPeer
from mobee.arrays import Array, Ints
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world import World
from mobee.robot.robot import Robot

GRAZE = 1e-6  # m
MINIMAL = 1e-9  # m; how far a depth may be from the way along its normal, and beyond the way along a peer's
_EXACT = {"coal": 1e-6, "python-fcl": 2e-6}  # m; how far the depths may differ without cylinders and hulls; fcl's own tolerance is 1e-6
UNKNOWN = 1e3  # m; a depth that is no depth
_SEARCHED = {"cylinder", "convex"}

Pair = tuple[int, int]
# Detection in one pose: pairs (c, 2) of volumes, depths (c,) m and where the first must move (c, 3).
Detect = Callable[[int], tuple[Ints, Array, Array]]


@dataclass(frozen=True, slots=True)
class Agreement:
    """The model beside one peer, over all poses."""

    peer: str
    scene: str
    objects: int
    poses: int
    contacts: int
    other_pairs: int  # found by one of the two only
    deepest_other: float  # m, depth of the deepest such pair
    depth_difference: dict[str, float]  # m, greatest by kinds, "box-capsule"
    same_depths: float  # share of the contacts in which they differ by no more than MINIMAL
    beaten: float  # m, by how much the way out along a normal of the peer's is shorter at most
    passed: bool


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot in a world, and poses (B, n)."""

    name: str
    robot: Robot
    world: World
    q: Array


class Found:
    """The model's contacts in a scene, pose by pose, and where all volumes are."""

    def __init__(self, scene: Scene) -> None:
        pose: Pose = Model(scene.robot, scene.world).evaluate(scene.q)
        table, self._transforms = pose.table, pose.transforms
        self.contacts: list[dict[Pair, tuple[float, Array]]] = [{} for _ in scene.q]
        for at, first, second, depth, normal in zip(
            *(getattr(table, what).tolist() for what in ("pose", "first", "second", "depth")), table.normal, strict=True
        ):
            self.contacts[at][first, second] = depth, normal
        self.volumes: tuple[Volume, ...] = (*scene.robot.shapes, *scene.world.objects.values())
        self._links = [shape.link for shape in scene.robot.shapes]

    def __len__(self) -> int:
        return sum(map(len, self.contacts))

    def way(self, pose: int, pair: Pair, direction: Array) -> float:
        """The way [m] out of the second volume for the first, along the unit vector (3,)."""
        (first, at), (second, there) = (self._placed(pose, index) for index in pair)
        return way_out(first, at, second, there, direction)

    def off(self) -> float:
        """By how much a depth differs from the way along its normal at most [m]."""
        return max(
            (
                abs(self.way(at, pair, normal) - depth)
                for at, contacts in enumerate(self.contacts)
                for pair, (depth, normal) in contacts.items()
            ),
            default=0.0,
        )

    def _placed(self, pose: int, index: int) -> tuple[Volume, tuple[Array, Array]]:
        volume = self.volumes[index]
        if index >= len(self._links):
            return volume, (volume.position, volume.rotation)
        now = self._transforms[pose, self._links[index]]
        return volume, (now[:3, :3] @ volume.position + now[:3, 3], now[:3, :3] @ volume.rotation)


def agreements(scene: Scene, with_coal: bool) -> tuple[list[Agreement], float]:
    """The model beside MuJoCo, python-fcl and, if it is there, coal; and how far a depth is from the way along its normal at most [m]."""
    ours = Found(scene)
    peers: dict[str, Detect] = {"MuJoCo": _mujoco(scene), "python-fcl": _fcl(scene)}
    if with_coal:
        peers["coal"] = _coal(scene)
    return [compared(name, scene, ours, detect) for name, detect in peers.items()], ours.off()


def compared(peer: str, scene: Scene, ours: Found, detect: Detect) -> Agreement:
    """The model beside one peer."""
    other: list[float] = []
    differences: dict[str, list[float]] = defaultdict(list)
    beaten = 0.0
    for at, mine in enumerate(ours.contacts):
        theirs = _by_pair(*detect(at))
        other += [(mine.get(pair) or theirs[pair])[0] for pair in mine.keys() ^ theirs.keys()]
        for pair in mine.keys() & theirs.keys():
            depth, normal = theirs[pair]
            if not (abs(depth) < UNKNOWN and np.isfinite(normal).all()):
                continue  # coal knows no depth of some cylinders
            differences["-".join(sorted(ours.volumes[index].kind for index in pair))].append(abs(mine[pair][0] - depth))
            beaten = max(beaten, mine[pair][0] - ours.way(at, pair, normal))
    difference = {kinds: max(found) for kinds, found in sorted(differences.items())}
    every = [value for found in differences.values() for value in found]
    return Agreement(
        peer=peer,
        scene=scene.name,
        objects=len(scene.world.objects),
        poses=len(scene.q),
        contacts=len(ours),
        other_pairs=len(other),
        deepest_other=max(other, default=0.0),
        depth_difference=difference,
        same_depths=float(np.mean(np.array(every) <= MINIMAL)) if every else 1.0,
        beaten=beaten,
        passed=max(other, default=0.0) < GRAZE and beaten <= MINIMAL and _exact(peer, difference),
    )


def _exact(peer: str, difference: Mapping[str, float]) -> bool:
    """Whether the depths are the same where this peer knows closed forms for them, or finds them to its tolerance."""
    judged = [value for kinds, value in difference.items() if not _SEARCHED & set(kinds.split("-"))]
    return peer not in _EXACT or max(judged, default=0.0) <= _EXACT[peer]


def _by_pair(pairs: Ints, depths: Array, normals: Array) -> dict[Pair, tuple[float, Array]]:
    return {
        (first, second): (depth, normal) for (first, second), depth, normal in zip(pairs.tolist(), depths.tolist(), normals, strict=True)
    }


def _mujoco(scene: Scene) -> Detect:
    peer = MujocoPeer(scene.robot, scene.world.objects, precise=True)
    angles = peer.joint_angles(scene.q)

    def detect(pose: int) -> tuple[Ints, Array, Array]:
        peer.detect(angles[pose])
        return peer.touching()

    return detect


def _fcl(scene: Scene) -> Detect:
    model = Model(scene.robot, scene.world, engine="fcl")

    def detect(pose: int) -> tuple[Ints, Array, Array]:
        table = model.evaluate(scene.q[pose]).table
        return np.stack([table.first, table.second], axis=1), table.depth, table.normal

    return detect


def _coal(scene: Scene) -> Detect:
    peer = CoalPeer(scene.robot, scene.world.snapshot)
    return lambda pose: peer.touching(scene.q[pose])
