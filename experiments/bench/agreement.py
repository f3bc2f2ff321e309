# SPDX-License-Identifier: Apache-2.0
"""Compares the contacts of the model with those of its peers, which are MuJoCo, python-fcl and coal.

The pairs of volumes in contact must be the same, and the model's depths must be right and minimal.

If two volumes overlap by less than MIN_OVERLAP, two programs may differ on whether they touch.  A depth is *right* if it is the distance
that the first volume must move along the normal until a plane separates the two.  It is *minimal* if no peer gives a direction in which a
shorter motion separates the volumes.  `separation` computes this distance for any direction.  Therefore the model can be compared with
peers whose own depths are not minimal: MuJoCo's depths of contact points, and the depths that coal and fcl find for cylinders by iterative
searches.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from experiments.bench.peers import MujocoPeer
from experiments.bench.scenes import Scene
from mobee.arrays import Array, Ints
from mobee.model.model import Model
from mobee.model.pose import Pose
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Shape

MIN_OVERLAP = 1e-6  # m
DEPTH_TOLERANCE = 1e-9  # m; of a depth from the separation along its normal, and beyond that along a peer's
_PEER_TOLERANCE = {"coal": 1e-6, "python-fcl": 2e-6}  # m; difference of depths without cylinders and hulls; fcl's own tolerance is 1e-6
UNKNOWN_DEPTH = 1e3  # m; a peer reports more where it computes no depth
_SEARCHED = {"cylinder", "convex"}  # kinds for which peers search iteratively

Pair = tuple[int, int]
# Detection in one pose: pairs (c, 2) of volumes, depths (c,) m and directions (c, 3) that move the first out.
Detect = Callable[[int], tuple[Ints, Array, Array]]

Volume = Shape | WorldObject
Place = tuple[Array, Array]
"""Pose of a volume: position (3,) m and rotation (3, 3), root frame."""


@dataclass(frozen=True, slots=True)
class Agreement:
    """Comparison of the model's contacts with those of one peer, over all poses of a scene.

    `contacts`: number of the model's contacts.  `other_pairs`: number of contacts that only one of the two programs finds; `deepest_other`:
    depth of the deepest such contact [m], 0 if there is none.  `depth_difference`: largest difference between the depths of both programs
    [m], by kinds of volumes ("box-capsule").  `same_depths`: share of the contacts whose depths differ by at most DEPTH_TOLERANCE (1e-9 m).
    `beaten`: largest amount [m] by which the model's depth exceeds the motion along the peer's normal that separates the volumes; 0 if it
    never does (the model's depth should be minimal).  `passed`: whether all differences are within their tolerances.
    """

    peer: str
    scene: str
    objects: int
    poses: int
    contacts: int
    other_pairs: int
    deepest_other: float
    depth_difference: dict[str, float]
    same_depths: float
    beaten: float
    passed: bool


class ModelContacts:
    """The model's contacts in all poses of a scene, and the poses of all volumes; len() returns the number of contacts.

    `contacts`: for each pose, a dict from pairs of indices in `volumes` to depth [m] and normal (3,), root frame.  `volumes`: the robot's
    shapes, then the world's objects.
    """

    def __init__(self, scene: Scene) -> None:
        pose: Pose = Model(scene.robot, scene.world).evaluate(scene.q)
        table, self._transforms = pose.table, pose.transforms
        self.contacts: list[dict[Pair, tuple[float, Array]]] = [{} for _ in scene.q]
        for at, first, second, depth, normal in zip(
            *(getattr(table, name).tolist() for name in ("pose", "first", "second", "depth")), table.normal, strict=True
        ):
            self.contacts[at][first, second] = depth, normal
        self.volumes: tuple[Volume, ...] = (*scene.robot.shapes, *scene.world.objects.values())
        self._links = [shape.link for shape in scene.robot.shapes]

    def __len__(self) -> int:
        return sum(map(len, self.contacts))

    def separation(self, pose: int, pair: Pair, direction: Array) -> float:
        """Return how far [m] the first volume of a pair must move along the unit vector `direction` (3,) to leave the second one.

        `pose`: index of the pose.  `pair`: indices in `volumes`.
        """
        (first, at), (second, there) = (self._placed(pose, index) for index in pair)
        return separation(first, at, second, there, direction)

    def depth_error(self) -> float:
        """Return the largest error [m] of the model's depths, over all contacts in all poses; 0 if there is no contact.

        For each contact, the method `separation` computes how far the first volume must move along the contact's normal to leave the second
        one.  The error is the absolute difference between this distance and the depth.
        """
        return max(
            (
                abs(self.separation(at, pair, normal) - depth)
                for at, contacts in enumerate(self.contacts)
                for pair, (depth, normal) in contacts.items()
            ),
            default=0.0,
        )

    def _placed(self, pose: int, index: int) -> tuple[Volume, Place]:
        volume = self.volumes[index]
        if index >= len(self._links):
            return volume, (volume.position, volume.rotation)
        now = self._transforms[pose, self._links[index]]
        return volume, (now[:3, :3] @ volume.position + now[:3, 3], now[:3, :3] @ volume.rotation)


def agreements(scene: Scene, with_coal: bool) -> tuple[list[Agreement], float]:
    """Compare the model with MuJoCo, python-fcl and, if `with_coal`, coal.

    Returns a comparison for each peer, and the model's largest depth error [m], as `ModelContacts.depth_error` returns it.
    """
    ours = ModelContacts(scene)
    peers: dict[str, Detect] = {"MuJoCo": _mujoco(scene), "python-fcl": _fcl(scene)}
    if with_coal:
        peers["coal"] = _coal(scene)
    return [compared(name, scene, ours, detect) for name, detect in peers.items()], ours.depth_error()


def compared(peer: str, scene: Scene, ours: ModelContacts, detect: Detect) -> Agreement:
    """Compare the contacts `ours` of the model with those of the peer.

    `detect`: function that takes the index of a pose and returns the peer's contacts: pairs (c, 2) of indices in `ours.volumes`, depths
    (c,) m, and unit vectors (c, 3), root frame, along which the first volume moves out of the second.  A contact's depth is not compared if
    the peer has not computed it: if its absolute value is at least UNKNOWN_DEPTH (1000 m), or the unit vector is not finite.
    """
    other: list[float] = []
    differences: dict[str, list[float]] = defaultdict(list)
    beaten = 0.0
    for at, mine in enumerate(ours.contacts):
        theirs = _by_pair(*detect(at))
        other += [(mine.get(pair) or theirs[pair])[0] for pair in mine.keys() ^ theirs.keys()]
        for pair in mine.keys() & theirs.keys():
            depth, normal = theirs[pair]
            if not (abs(depth) < UNKNOWN_DEPTH and np.isfinite(normal).all()):
                continue  # coal computes no depth of some cylinders
            differences["-".join(sorted(ours.volumes[index].kind for index in pair))].append(abs(mine[pair][0] - depth))
            beaten = max(beaten, mine[pair][0] - ours.separation(at, pair, normal))
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
        same_depths=float(np.mean(np.array(every) <= DEPTH_TOLERANCE)) if every else 1.0,
        beaten=beaten,
        passed=max(other, default=0.0) < MIN_OVERLAP and beaten <= DEPTH_TOLERANCE and _depths_agree(peer, difference),
    )


def _depths_agree(peer: str, difference: Mapping[str, float]) -> bool:
    """Return whether the depths of both programs agree within the tolerance of this peer; True if the peer has no tolerance.

    `difference`: largest difference of depths [m] by kinds of volumes ("box-capsule").  Pairs with a cylinder or a convex hull are not
    judged, because the peers compute their depths by iterative search.
    """
    judged = [value for kinds, value in difference.items() if not _SEARCHED & set(kinds.split("-"))]
    return peer not in _PEER_TOLERANCE or max(judged, default=0.0) <= _PEER_TOLERANCE[peer]


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
    from experiments.bench.collision_peers import CoalPeer  # raises NotInstalled without python-fcl

    peer = CoalPeer(scene.robot, scene.world.snapshot)
    return lambda pose: peer.touching(scene.q[pose])


def separation(first: Volume, at: Place, second: Volume, there: Place, direction: Array) -> float:
    """Return how far [m] the first volume must move along a unit vector until a plane separates it from the second one.

    `direction`: the unit vector (3,), root frame.  `at`, `there`: poses of the first and the second volume.
    """
    return extent(second, there, direction) + extent(first, at, -direction)


def extent(volume: Volume, place: Place, direction: Array) -> float:
    """Return the support function [m] of a volume: the largest projection of its points on a unit vector.

    `place`: pose of the volume.  `direction`: the unit vector (3,), root frame.  The projections are measured from the origin of the root
    frame.
    """
    position, rotation = place
    along = rotation.T @ direction
    return float(direction @ position) + _own_extent(volume, along)


def _own_extent(volume: Volume, along: Array) -> float:
    size = volume.size
    if volume.kind == "box":
        return 0.5 * float(np.abs(along) @ size)
    if volume.kind == "convex":
        assert isinstance(volume, Shape) and volume.vertices is not None
        return float((volume.vertices @ along).max())
    if volume.kind == "sphere":
        return size[0]
    side = float(np.hypot(along[0], along[1])) if volume.kind == "cylinder" else 1.0
    return size[0] * side + 0.5 * size[1] * abs(float(along[2]))
