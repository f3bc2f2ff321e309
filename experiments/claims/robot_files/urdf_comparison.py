# SPDX-License-Identifier: Apache-2.0
"""Compares how this library and Pinocchio read a URDF file: frames of links, and contacts, which coal computes from Pinocchio's shapes."""

from __future__ import annotations

import contextlib
import time
import warnings
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments.bench.peers import import_peer, make_searches_precise
from experiments.kit.run_folder import Row
from mobee.arrays import Array
from mobee.check.interface import Subject
from mobee.errors import MobeeError
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import CORNERS

LinkPair = frozenset[str]
MIN_OVERLAP = 1e-6  # m; two correct programs may differ on whether a pair touches that overlaps by less
NO_ROBOT = "no joint moves"  # part of the reader's message for a file that describes no robot
EMPTY_SRDF = '<robot name="none"/>\n'


@dataclass(frozen=True, slots=True)
class FileRecord(Row):
    """The results of one URDF file; measurements that are missing are nan, counts -1.

    `outcome`: "loads", "thing" (no joint moves, so it is no robot), "refused" or "crash".  `message`: why it was refused, crashed or not
    compared.  `links`: number of links whose frames were compared.  `srdf`: name of the SRDF that was found; `home`: name of the pose in
    it.  `seconds`: time to load, with default options.  `frame_error`: largest difference of an element of a link's frame from Pinocchio's
    [m or 1].  `contacts`: number of contacts between links that the collision library coal finds, summed over all poses.  `other`: number
    of contacts deeper than 1e-6 m that only coal or only this library finds, summed likewise; `deepest_other`: largest depth of a contact
    that only one of them finds [m].  `at_home`: number of solid contacts at home, with default options; `at_home_without`: the same without
    an SRDF.
    """

    PLACES = None  # frames differ by 1e-16

    name: str
    outcome: str
    message: str = ""
    motors: int = -1
    links: int = -1
    srdf: str = ""
    home: str = ""
    seconds: float = np.nan
    frame_error: float = np.nan
    contacts: int = -1
    other: int = -1
    deepest_other: float = np.nan
    at_home: int = -1
    at_home_without: int = -1


def compare_file(name: str, path: Path, poses: int, seed: int, scratch: Path) -> FileRecord:
    """Load a URDF file, compare it with Pinocchio (frames) and coal (contacts) in random poses, and return the record.

    The contacts are compared with exact convex hulls of the meshes, all else with default options.  `name`: of the file, for the record.
    `poses`: number of random poses.  `seed`: of these.  `scratch`: a folder, where an empty SRDF is written.  Any error while the file is
    loaded is recorded, not raised.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            start = time.perf_counter()
            robot = load_robot(path)
            seconds = time.perf_counter() - start
        except MobeeError as error:
            message = _plain(error, path)
            return FileRecord(name, "thing" if NO_ROBOT in message else "refused", message)
        except Exception as error:  # counted: no file may cause this
            return FileRecord(name, "crash", f"{type(error).__name__}: {_plain(error, path)}")
        empty = scratch / "empty.srdf"
        empty.write_text(EMPTY_SRDF)
        bare = load_robot(path, srdf=empty)
        rounded = any(shape.vertices is not None and len(shape.vertices) <= CORNERS for shape in robot.shapes)
        exact = load_robot(path, corners="all") if rounded else robot
    return _compared(FileRecord(name, "loads", seconds=seconds, **_described(robot, bare)), path, exact, poses, seed)


def _plain(error: Exception, path: Path) -> str:
    """Return the message in one line, without the folders of this machine."""
    text = " ".join(str(error).split())
    for folder in (*path.absolute().parents, *path.resolve().parents):
        text = text.replace(f"{folder}/", "") if folder.parts[1:] else text
    return text


def _described(robot: Robot, bare: Robot) -> dict[str, Any]:
    srdf = robot.where.get(("srdf", robot.name), "")
    return {
        "motors": len(robot.motors),
        "srdf": Path(srdf.rpartition(":")[0]).name,
        "home": next((name for kind, name in robot.where if kind == "pose"), ""),
        "at_home": _at_home(robot),
        "at_home_without": _at_home(bare),
    }


def _at_home(robot: Robot) -> int:
    return sum(contact.kind == "solid" for contact in Model(robot).evaluate(robot.home).contacts)


def _compared(found: FileRecord, path: Path, robot: Robot, poses: int, seed: int) -> FileRecord:
    """Compare with Pinocchio and coal on the same file, in random poses within the limits; returns the record with the results."""
    known = asdict(found)
    low, high = robot.limits.T
    q = np.random.default_rng(seed).uniform(low, high, size=(poses, len(robot.motors)))
    matrix, offset = robot.coupling
    angles = q @ matrix.T + offset
    try:
        peer = UrdfPeer(path, robot)
        known["links"] = len({*robot.links, *robot.markers} & peer.frames(angles[0]).keys())
        known["frame_error"] = _frame_error(robot, peer, q, angles)
        subject = Subject(robot)
        owners = [subject.urdf_link(shape.name) or "" for shape in robot.shapes]
        peer.read_shapes({frozenset((owners[i], owners[j])) for i, j in robot.solid_pairs.tolist()})
    except PeerFailed as error:
        return FileRecord(**known | {"message": _plain(error, path)})
    ours = _contacts(robot, owners, q)
    known |= {"contacts": 0, "other": 0, "deepest_other": 0.0}
    for mine, place in zip(ours, angles, strict=True):
        theirs = peer.touching(place)
        depths = [(mine | theirs)[pair] for pair in mine.keys() ^ theirs.keys()]
        known["contacts"] += len(theirs)
        known["other"] += sum(depth > MIN_OVERLAP for depth in depths)
        known["deepest_other"] = max(known["deepest_other"], *depths, 0.0)
    return FileRecord(**known)


def _frame_error(robot: Robot, peer: UrdfPeer, q: Array, angles: Array) -> float:
    """Return the largest difference of an element of a link's frame (4, 4) between this library and Pinocchio, over all poses.

    Links that no joint moves have no frame in this library; their frames are those of its markers.  `q`: the poses, positions of motors
    (P, n).  `angles`: the same poses, positions of joints (P, J) for `peer`.
    """
    zero = peer.frames(np.zeros(len(robot.joints)))
    worst = 0.0
    for pose, joints in zip(q, angles, strict=True):
        motion, frames = link_transforms(robot, pose), peer.frames(joints)
        for index, link in enumerate(robot.links):
            worst = max(worst, float(np.abs(motion[index] @ zero[link] - frames[link]).max()))
        for marker in (one for name, one in robot.markers.items() if name in frames):
            there = np.eye(4)
            there[:3, :3], there[:3, 3] = marker.rotation, marker.position
            worst = max(worst, float(np.abs(motion[marker.link] @ there - frames[marker.name]).max()))
    return worst


def _contacts(robot: Robot, owners: list[str], q: Array) -> list[dict[LinkPair, float]]:
    """Return for each pose a dict from the pairs of links whose solids touch to the largest depth [m].

    `owners`: name of the URDF link of each shape of the robot.  `q`: the poses, (P, n).
    """
    table = Model(robot).evaluate(q).table
    found: list[dict[LinkPair, float]] = [{} for _ in q]
    columns = (table.pose, table.first, table.second, table.kind, table.depth)
    for pose, first, second, kind, depth in zip(*(column.tolist() for column in columns), strict=True):
        if kind == 0:
            pair = frozenset((owners[first], owners[second]))
            found[pose][pair] = max(depth, found[pose].get(pair, 0.0))
    return found


class PeerFailed(Exception):
    """Raised if Pinocchio or coal cannot read a file that this library has read; the message says why."""


class UrdfPeer:
    """The robot of a URDF file as Pinocchio reads it; its methods take joint positions in MoBeE's order, that of `Robot.joints`."""

    def __init__(self, path: Path, robot: Robot) -> None:
        """Read the file.  `robot`: the same file as this library reads it.

        Raises NotInstalled without Pinocchio, and PeerFailed if Pinocchio cannot read the file or does not have all joints of `robot`.
        """
        pinocchio = import_peer("pinocchio", "Pinocchio", extra="dev")
        self._pin, self._robot, self._path = pinocchio, robot, path.resolve()
        try:
            self._model = pinocchio.buildModelFromUrdf(str(self._path))
        except Exception as error:  # its parsers raise errors of any type
            raise PeerFailed(f"Pinocchio: {_line(error)}") from error
        self._data = self._model.createData()
        self._frames = {frame.name: k for k, frame in enumerate(self._model.frames) if frame.type == pinocchio.FrameType.BODY}
        self._columns = self._moving_joints()

    def _moving_joints(self) -> list[tuple[int, int]]:
        """Return for each joint of the robot the index of its first element in Pinocchio's configuration vector, and its element count.

        The joints are in the order of `Robot.joints`.  A joint has one element, its position [rad or m], or two, the cosine and the sine of
        its angle.  The method also sets the attribute `_neutral`, the configuration from which `_configuration` takes the elements of all
        joints that only Pinocchio's model has, because this library does not move them.  Such a joint is at the lower limit of its range if
        it has one element, otherwise at Pinocchio's neutral position.  Raises PeerFailed if Pinocchio's model does not have all joints of
        the robot.
        """
        self._neutral = self._pin.neutral(self._model)
        known = {joint.name for joint in self._robot.joints}
        columns = {}
        for name, joint in zip(self._model.names, self._model.joints, strict=True):
            columns[name] = joint.idx_q, joint.nq
            if name not in known and joint.nq == 1:
                self._neutral[joint.idx_q] = self._model.lowerPositionLimit[joint.idx_q]
        absent = known - set(columns)
        if absent:
            raise PeerFailed(f"Pinocchio: has no joint {sorted(absent)[0]}")
        return [columns[joint.name] for joint in self._robot.joints]

    def _configuration(self, angles: Array) -> Array:
        q: Array = self._neutral.copy()
        for (start, count), angle in zip(self._columns, angles.tolist(), strict=True):
            q[start : start + count] = (angle,) if count == 1 else (np.cos(angle), np.sin(angle))
        return q

    def frames(self, angles: Array) -> dict[str, Array]:
        """Return a dict from the name of every link to its pose (4, 4) in the frame of the root link.

        `angles`: positions of the robot's joints (J,), rad or m.
        """
        self._pin.framesForwardKinematics(self._model, self._data, self._configuration(angles))
        return {name: self._data.oMf[k].homogeneous for name, k in self._frames.items()}

    def read_shapes(self, tested: set[LinkPair]) -> None:
        """Read the collision geometry from the file, with meshes as exact convex hulls; raises PeerFailed if it cannot be read.

        `tested`: the pairs of links whose shapes are tested.
        """
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
        make_searches_precise(self._found)

    def touching(self, angles: Array) -> dict[LinkPair, float]:
        """Return a dict from each pair of links that touch to the depth [m].  `angles`: positions of the robot's joints (J,), rad or m.

        `read_shapes` must be called before.
        """
        self._pin.computeCollisions(self._model, self._data, self._geometry, self._found, self._configuration(angles), False)
        found: dict[LinkPair, float] = {}
        for row, result in enumerate(self._found.collisionResults):
            if result.isCollision():
                depth = -self._pin.computeDistance(self._geometry, self._found, row).min_distance
                found[self._pairs[row]] = max(depth, found.get(self._pairs[row], 0.0))
        return found


def _hull(geometry: Any) -> Any:
    if not isinstance(geometry, import_peer("coal", "coal", extra="dev").BVHModelBase):
        return geometry
    geometry.buildConvexHull(True, "Qt")  # returns whether the mesh was convex already
    if geometry.convex is None:
        raise ValueError("a mesh has no convex hull")
    return geometry.convex


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
