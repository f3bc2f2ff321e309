"""python-fcl on the workload, in its two ways: pair by pair, and with its trees of bounding boxes.

Only whether each pair touches is asked for, which is the least that fcl can do.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mobee.collision.fcl_engine import fcl  # raises NotInstalled
from mobee.collision.snapshot import Snapshot
from mobee.collision.tested_pairs import tested_pairs
from mobee.collision.world_object import WorldObject
from mobee.engine.hands import NOBODY
from mobee.robot.robot import Array, Robot, Shape

_MAKERS = {"sphere": fcl.Sphere, "capsule": fcl.Capsule, "box": fcl.Box}


class _Placer:
    """fcl's objects of a robot and a world; only the robot's are moved."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        self.shapes = [_object(shape) for shape in robot.shapes]
        self.things = [_object(thing) for thing in snapshot.objects.values()]
        self._links = np.array([shape.link for shape in robot.shapes])
        self._zero = np.tile(np.eye(4), (len(robot.shapes), 1, 1))
        for pose, shape in zip(self._zero, robot.shapes, strict=True):
            pose[:3, :3], pose[:3, 3] = shape.rotation, shape.position

    def place(self, transforms: Array) -> None:
        """Move the shapes to where their links are, (L, 4, 4)."""
        now = transforms[self._links] @ self._zero
        for body, turn, at in zip(self.shapes, now[:, :3, :3], now[:, :3, 3], strict=True):
            body.setTransform(fcl.Transform(turn, at))


class FclPairs(_Placer):
    """Every tested pair, one after the other."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        super().__init__(robot, snapshot)
        volumes = self.shapes + self.things
        first, second, _ = tested_pairs(robot, snapshot, NOBODY)
        self._pairs = [(volumes[a], volumes[b]) for a, b in zip(first, second, strict=True)]
        self._request, self._result = fcl.CollisionRequest(), fcl.CollisionResult()

    def __len__(self) -> int:
        return len(self._pairs)

    def detect(self, transforms: Array) -> int:
        """How many pairs touch in the pose of `transforms` (L, 4, 4)."""
        self.place(transforms)
        request, result, collide = self._request, self._result, fcl.collide
        return sum(collide(a, b, request, result) > 0 for a, b in self._pairs)


class FclTrees(_Placer):
    """Dynamic trees of axis-aligned boxes, one for the robot and one for the world, and a callback for what they let through."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        super().__init__(robot, snapshot)
        self._robot, self._world = fcl.DynamicAABBTreeCollisionManager(), fcl.DynamicAABBTreeCollisionManager()
        for manager, bodies in ((self._robot, self.shapes), (self._world, self.things)):
            manager.registerObjects(bodies)
            manager.setup()
        first, second, _ = tested_pairs(robot, snapshot, NOBODY)
        volumes = [id(body) for body in self.shapes + self.things]
        self._tested = {key for a, b in zip(first, second, strict=True) for key in ((volumes[a], volumes[b]), (volumes[b], volumes[a]))}
        self._request, self._result = fcl.CollisionRequest(), fcl.CollisionResult()
        self._has_world = bool(self.things)

    def detect(self, transforms: Array) -> int:
        """How many pairs touch in the pose of `transforms` (L, 4, 4)."""
        self.place(transforms)
        self._robot.update()
        touching = [0]
        self._robot.collide(touching, self._near)
        if self._has_world:
            self._robot.collide(self._world, touching, self._near)
        return touching[0]

    def _near(self, one: Any, other: Any, touching: list[int]) -> bool:
        if (id(one), id(other)) in self._tested and fcl.collide(one, other, self._request, self._result) > 0:
            touching[0] += 1
        return False  # go on


def _object(volume: Shape | WorldObject) -> Any:
    return fcl.CollisionObject(_MAKERS[volume.kind](*volume.size), fcl.Transform(volume.rotation, volume.position))
