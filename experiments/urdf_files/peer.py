"""Another reading of a URDF: Pinocchio's own frames and shapes, and coal's contacts between exact convex hulls."""

from __future__ import annotations

import contextlib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.errors import MobeeError
from mobee.robot.robot import Robot

LinkPair = frozenset[str]
# Of coal's iterative searches [m].  With 1e-6 or 1e-9 it misses contacts of cylinders, up to 46 mm deep (baxter), which polytopes inside
# of them and python-fcl confirm; its plain search misses contacts of some micrometres.
_TOLERANCE, _ITERATIONS, _SEARCH = 1e-12, 1000, "NesterovAcceleration"


class PeerMissing(MobeeError):
    """Raised when Pinocchio, which brings coal, is not installed."""


class PeerFailed(Exception):
    """Raised when Pinocchio or coal cannot read what this library has read; says why."""


class UrdfPeer:
    """The robot of a URDF file as Pinocchio reads it, moved by our motors."""

    def __init__(self, path: Path, robot: Robot) -> None:
        try:
            import pinocchio
        except ImportError:
            raise PeerMissing('Pinocchio and coal are not installed: pip install "mobee[dev]"') from None
        self._pin, self._robot, self._path = pinocchio, robot, path.resolve()
        try:
            self._model = pinocchio.buildModelFromUrdf(str(self._path))
        except Exception as error:  # its parsers raise what they like
            raise PeerFailed(f"Pinocchio: {_line(error)}") from error
        self._data = self._model.createData()
        self._frames = {frame.name: k for k, frame in enumerate(self._model.frames) if frame.type == pinocchio.FrameType.BODY}
        self._places = self._moving_joints()

    def _moving_joints(self) -> list[tuple[int, int]]:
        """Where the configuration holds each of the robot's joints, and in how many numbers; sets those that have no play."""
        self._still = self._pin.neutral(self._model)
        known = {joint.name for joint in self._robot.joints}
        places = {}
        for name, joint in zip(self._model.names, self._model.joints, strict=True):
            places[name] = joint.idx_q, joint.nq
            if name not in known and joint.nq == 1:
                self._still[joint.idx_q] = self._model.lowerPositionLimit[joint.idx_q]
        missing = known - set(places)
        if missing:
            raise PeerFailed(f"Pinocchio: has no joint {sorted(missing)[0]}")
        return [places[joint.name] for joint in self._robot.joints]

    def _configuration(self, angles: Array) -> Array:
        q: Array = self._still.copy()
        for (start, count), angle in zip(self._places, angles.tolist(), strict=True):
            q[start : start + count] = (angle,) if count == 1 else (np.cos(angle), np.sin(angle))
        return q

    def frames(self, angles: Array) -> dict[str, Array]:
        """The frame (4, 4) of every link at joint positions (J,)."""
        self._pin.framesForwardKinematics(self._model, self._data, self._configuration(angles))
        return {name: self._data.oMf[k].homogeneous for name, k in self._frames.items()}

    def read_shapes(self, tested: set[LinkPair]) -> None:
        """Read the collision geometry, meshes as exact convex hulls; `tested`: the pairs of links whose shapes are tested."""
        pin, folders = self._pin, [str(folder) for folder in self._path.parents]
        try:
            with contextlib.chdir(self._path.parent):  # where Pinocchio looks for a plain path
                found = pin.buildGeomFromUrdf(self._model, str(self._path), pin.GeometryType.COLLISION, package_dirs=folders)
            self._geometry = pin.GeometryModel()
            for one in found.geometryObjects:
                one.geometry = _hull(one.geometry)
                self._geometry.addGeometryObject(one)
        except Exception as error:  # as above
            raise PeerFailed(f"coal: {_line(error)}") from error
        links = [self._model.frames[one.parentFrame].name for one in self._geometry.geometryObjects]
        self._pairs = [frozenset((a, b)) for k, a in enumerate(links) for b in links[k + 1 :] if frozenset((a, b)) in tested]
        for k, a in enumerate(links):
            for m in range(k + 1, len(links)):
                if frozenset((a, links[m])) in tested:
                    self._geometry.addCollisionPair(pin.CollisionPair(k, m))
        self._found = pin.GeometryData(self._geometry)
        for request in self._found.distanceRequests:
            request.enable_signed_distance = True
        search = _coal().GJKVariant.names[_SEARCH]
        for request in (*self._found.distanceRequests, *self._found.collisionRequests):
            request.gjk_variant = search
            request.gjk_tolerance = request.epa_tolerance = _TOLERANCE
            request.gjk_max_iterations = request.epa_max_iterations = _ITERATIONS
            with warnings.catch_warnings():  # deprecated, but the setting that is to replace it has no effect
                warnings.simplefilter("ignore", DeprecationWarning)
                request.enable_cached_gjk_guess = False  # begun where the last pose's search ended, coal misses contacts

    def touching(self, angles: Array) -> dict[LinkPair, float]:
        """The pairs of links that touch at joint positions (J,), and how deep they do [m]."""
        self._pin.computeCollisions(self._model, self._data, self._geometry, self._found, self._configuration(angles), False)
        found: dict[LinkPair, float] = {}
        for row, result in enumerate(self._found.collisionResults):
            if result.isCollision():
                depth = -self._pin.computeDistance(self._geometry, self._found, row).min_distance
                found[self._pairs[row]] = max(depth, found.get(self._pairs[row], 0.0))
        return found


def _coal() -> Any:
    import coal

    return coal


def _hull(geometry: Any) -> Any:
    if not isinstance(geometry, _coal().BVHModelBase):
        return geometry
    geometry.buildConvexHull(True, "Qt")  # says whether the mesh was convex already
    if geometry.convex is None:
        raise ValueError("a mesh has no convex hull")
    return geometry.convex


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
