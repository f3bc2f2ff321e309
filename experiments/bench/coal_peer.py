"""Pinocchio and coal on the workload, as an oracle: other kinematics, other collision detection, no bounding volumes of ours."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from mobee.collision.snapshot import Snapshot
from mobee.collision.tested_pairs import tested_pairs
from mobee.collision.world_object import WorldObject
from mobee.engine.hands import NOBODY
from mobee.errors import MobeeError
from mobee.robot.robot import Array, Ints, Robot, Shape

# Of coal's iterative searches [m]: with larger tolerances it misses contacts of cylinders, and by its plain search some of micrometres.
_TOLERANCE, _ITERATIONS, _SEARCH = 1e-12, 1000, "NesterovAcceleration"


class CoalMissing(MobeeError):
    """Raised when coal is asked for and Pinocchio, which brings it, is not installed."""


class CoalPeer:
    """A robot and the objects of a world as Pinocchio's models, with the same tested pairs."""

    def __init__(self, robot: Robot, snapshot: Snapshot) -> None:
        try:
            import coal
            import pinocchio
        except ImportError:
            raise CoalMissing("coal is not installed: pip install '.[dev]' in MoBeE's folder") from None
        self._pin, self._coupling = pinocchio, robot.coupling
        first, second, _ = tested_pairs(robot, snapshot, NOBODY)
        self.pairs = np.stack([first, second], axis=1)
        self._model = _tree(pinocchio, robot)
        self._geometry = _geometry(pinocchio, coal, robot, snapshot)
        for a, b in self.pairs.tolist():
            self._geometry.addCollisionPair(pinocchio.CollisionPair(a, b))
        self._data, self._found = self._model.createData(), pinocchio.GeometryData(self._geometry)
        for request in self._found.distanceRequests:
            request.enable_signed_distance = True
        search = coal.GJKVariant.names[_SEARCH]
        for request in (*self._found.distanceRequests, *self._found.collisionRequests):
            request.gjk_variant = search
            request.gjk_tolerance = request.epa_tolerance = _TOLERANCE
            request.gjk_max_iterations = request.epa_max_iterations = _ITERATIONS
            with warnings.catch_warnings():  # deprecated, but the setting that is to replace it has no effect
                warnings.simplefilter("ignore", DeprecationWarning)
                request.enable_cached_gjk_guess = False  # begun where the last pose's search ended, coal misses a contact of 1 mm

    def touching(self, q: Array) -> tuple[Ints, Array, Array]:
        """The pairs (c, 2) of volumes that touch in the pose q (n,), their depths (c,) m and where the first must move (c, 3)."""
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
    for volume in (*robot.shapes, *snapshot.objects.values()):
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
