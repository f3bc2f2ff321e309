# SPDX-License-Identifier: Apache-2.0
"""Collision detection by python-fcl and coal for a robot and the objects of a world, to compare MoBeE's model with them.

python-fcl computes only whether each pair touches, which is the fastest of its queries.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from experiments.bench.peers import import_peer, make_searches_precise
from mobee.arrays import Array, Ints
from mobee.model.engine import NO_HANDS, Snapshot
from mobee.model.fcl_engine import tested_pairs  # raises NotInstalled without python-fcl
from mobee.model.world_object import WorldObject
from mobee.robot.robot import Robot, Shape

fcl = import_peer("fcl", "python-fcl")
_MAKERS = {"sphere": fcl.Sphere, "capsule": fcl.Capsule, "box": fcl.Box}


class _FclScene:
    """fcl's objects of a robot and a world; only the robot's are moved."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        self.shapes = [_fcl_object(shape) for shape in robot.shapes]
        self.objects = [_fcl_object(one) for one in snapshot.objects.values()]
        self._links = np.array([shape.link for shape in robot.shapes])
        self._zero = np.tile(np.eye(4), (len(robot.shapes), 1, 1))
        for pose, shape in zip(self._zero, robot.shapes, strict=True):
            pose[:3, :3], pose[:3, 3] = shape.rotation, shape.position

    def place(self, transforms: Array) -> None:
        """Move the shapes with their links, whose poses are (L, 4, 4)."""
        now = transforms[self._links] @ self._zero
        for body, turn, at in zip(self.shapes, now[:, :3, :3], now[:, :3, 3], strict=True):
            body.setTransform(fcl.Transform(turn, at))


class FclPairs(_FclScene):
    """Collision detection by python-fcl that tests every pair of volumes, one after the other; len() returns the number of tested pairs."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        super().__init__(robot, snapshot)
        volumes = self.shapes + self.objects
        first, second, _ = tested_pairs(robot, snapshot, NO_HANDS)
        self._pairs = [(volumes[a], volumes[b]) for a, b in zip(first, second, strict=True)]
        self._request, self._result = fcl.CollisionRequest(), fcl.CollisionResult()

    def __len__(self) -> int:
        return len(self._pairs)

    def detect(self, transforms: Array) -> int:
        """Return the number of pairs of volumes that touch in one pose.  `transforms`: poses of the links (L, 4, 4), root frame."""
        self.place(transforms)
        request, result, collide = self._request, self._result, fcl.collide
        return sum(collide(a, b, request, result) > 0 for a, b in self._pairs)


class FclTrees(_FclScene):
    """Collision detection by python-fcl with trees of axis-aligned boxes, one for the robot and one for the world.

    A pair is tested only if the boxes of its volumes meet.
    """

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        super().__init__(robot, snapshot)
        self._robot, self._world = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
        for manager, bodies in ((self._robot, self.shapes), (self._world, self.objects)):
            manager.registerObjects(bodies)
            manager.setup()
        first, second, _ = tested_pairs(robot, snapshot, NO_HANDS)
        volumes = [id(body) for body in self.shapes + self.objects]
        self._tested = {key for a, b in zip(first, second, strict=True) for key in ((volumes[a], volumes[b]), (volumes[b], volumes[a]))}
        self._request, self._result = fcl.CollisionRequest(), fcl.CollisionResult()
        self._has_world = bool(self.objects)

    def detect(self, transforms: Array) -> int:
        """Return the number of pairs of volumes that touch in one pose.  `transforms`: poses of the links (L, 4, 4), root frame."""
        self.place(transforms)
        self._robot.update()
        touching = [0]
        self._robot.collide(touching, self._test_pair)
        if self._has_world:
            self._robot.collide(self._world, touching, self._test_pair)
        return touching[0]

    def _test_pair(self, one: Any, other: Any, touching: list[int]) -> bool:
        if (id(one), id(other)) in self._tested and fcl.collide(one, other, self._request, self._result) > 0:
            touching[0] += 1
        return False  # continue


def _fcl_object(volume: Shape | WorldObject) -> Any:
    return fcl.CollisionObject(_MAKERS[volume.kind](*volume.size), fcl.Transform(volume.rotation, volume.position))


class CoalPeer:
    """A robot and the objects of a world as models of Pinocchio, with the pairs of volumes that MoBeE tests; coal detects the contacts.

    `pairs` (P, 2): indices of the tested volumes: the robot's shapes come first, then the objects.
    """

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        """Build the models.  Raises NotInstalled if coal, which is installed with Pinocchio, is missing."""
        coal, pinocchio = (import_peer(module, "coal", extra="dev") for module in ("coal", "pinocchio"))
        self._pin, self._coupling = pinocchio, robot.coupling
        first, second, _ = tested_pairs(robot, snapshot, NO_HANDS)
        self.pairs = np.stack([first, second], axis=1)
        self._model = _tree(pinocchio, robot)
        self._geometry = _geometry(pinocchio, coal, robot, snapshot)
        for a, b in self.pairs.tolist():
            self._geometry.addCollisionPair(pinocchio.CollisionPair(a, b))
        self._data, self._found = self._model.createData(), pinocchio.GeometryData(self._geometry)
        make_searches_precise(self._found)

    def touching(self, q: Array) -> tuple[Ints, Array, Array]:
        """Return the contacts in pose q (n,) rad.

        They are given as pairs (c, 2) of volumes (indices: the robot's shapes come first, then the objects), depths (c,) m, and unit
        vectors (c, 3), root frame, along which the first volume moves out of the second.
        """
        matrix, offset = self._coupling
        pin = self._pin
        pin.computeCollisions(self._model, self._data, self._geometry, self._found, matrix @ q + offset, False)
        rows = np.flatnonzero([result.isCollision() for result in self._found.collisionResults])
        results = [pin.computeDistance(self._geometry, self._found, int(row)) for row in rows]
        depths = np.array([-result.min_distance for result in results])
        return self.pairs[rows], depths, np.array([-np.asarray(result.normal) for result in results]).reshape(-1, 3)


def _tree(pin: Any, robot: Robot) -> Any:
    model = pin.Model()
    for joint in robot.joints:
        hinge = pin.JointModelRevoluteUnaligned(joint.axis)
        shift = joint.point - (robot.joints[joint.parent - 1].point if joint.parent else 0.0)
        model.addJoint(joint.parent, hinge, pin.SE3(np.eye(3), shift), joint.name)
    return model


def _geometry(pin: Any, coal: Any, robot: Robot, snapshot: Snapshot) -> Any:
    geometry = pin.GeometryModel()
    volumes: tuple[Shape | WorldObject, ...] = (*robot.shapes, *snapshot.objects.values())
    for volume in volumes:
        link = volume.link if isinstance(volume, Shape) else 0
        origin = robot.joints[link - 1].point if link else np.zeros(3)
        place = pin.SE3(np.array(volume.rotation), volume.position - origin)
        geometry.addGeometryObject(pin.GeometryObject(volume.name, link, place, _shape(coal, volume)))
    return geometry


def _shape(coal: Any, volume: Shape | WorldObject) -> Any:
    if isinstance(volume, Shape) and volume.vertices is not None:
        points = coal.StdVec_Vec3s()
        points.extend(volume.vertices)
        return coal.Convex.convexHull(points, True, None)
    makers = {"sphere": coal.Sphere, "capsule": coal.Capsule, "cylinder": coal.Cylinder, "box": coal.Box}
    return makers[volume.kind](*volume.size)
