"""What is found out about one URDF file."""

from __future__ import annotations

import time
import warnings
from dataclasses import asdict, dataclass, fields
from pathlib import Path

import numpy as np

from experiments.urdf_files.peer import LinkPair, PeerFailed, UrdfPeer
from mobee.arrays import Array
from mobee.check.subject import Subject
from mobee.errors import MobeeError
from mobee.model.kinematics import link_transforms
from mobee.model.model import Model
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.hull import CORNERS

GRAZE = 1e-6  # m; of a pair that overlaps by less, two right programs may differ on whether it touches
THING = "no joint moves"  # what the reader says of a file that describes no robot
EMPTY_SRDF = '<robot name="none"/>\n'


@dataclass(frozen=True, slots=True)
class LookedAt:
    """One file; numbers that were not found are nan, or -1 where they count."""

    name: str
    outcome: str  # "loads", "thing", "refused" or "crash"
    message: str = ""  # of a refusal or crash, or why a comparison was not made
    motors: int = -1
    links: int = -1  # whose frames were compared
    srdf: str = ""  # name of the file that was found
    home: str = ""  # name of the pose in it
    seconds: float = np.nan  # to load, as a user gets it
    frame_error: float = np.nan  # m and 1: greatest difference of a number of a link's frame from Pinocchio's
    contacts: int = -1  # pairs of links that touch in the poses, by coal
    other: int = -1  # pairs that touch for one of the two only
    deepest_other: float = np.nan  # m
    at_home: int = -1  # solid contacts, as a user gets it
    at_home_without: int = -1  # the same without an SRDF

    @classmethod
    def columns(cls) -> tuple[str, ...]:
        """Of its record."""
        return tuple(one.name for one in fields(cls))

    def record(self) -> dict[str, str]:
        """The same as ASCII text."""
        return {name: str(value).encode("ascii", "backslashreplace").decode() for name, value in asdict(self).items()}

    @classmethod
    def of_record(cls, row: dict[str, str]) -> LookedAt:
        """From `record`."""
        kinds = {one.name: {"str": str, "int": int, "float": float}[str(one.type)] for one in fields(cls)}
        return cls(**{name: kinds[name](text) for name, text in row.items()})


def look_at(name: str, path: Path, poses: int, seed: int, scratch: Path) -> LookedAt:
    """Load the file, as a user does and with exact hulls, and compare; `scratch`: a folder for an SRDF without content."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            start = time.perf_counter()
            robot = load_robot(path)
            seconds = time.perf_counter() - start
        except MobeeError as error:
            message = _plain(error, path)
            return LookedAt(name, "thing" if THING in message else "refused", message)
        except Exception as error:  # to be counted: a file must never do this
            return LookedAt(name, "crash", f"{type(error).__name__}: {_plain(error, path)}")
        empty = scratch / "empty.srdf"
        empty.write_text(EMPTY_SRDF)
        bare = load_robot(path, srdf=empty)
        rounded = any(shape.vertices is not None and len(shape.vertices) <= CORNERS for shape in robot.shapes)
        exact = load_robot(path, corners="all") if rounded else robot
    return _compared(LookedAt(name, "loads", seconds=seconds, **_described(robot, bare)), path, exact, poses, seed)


def _plain(error: Exception, path: Path) -> str:
    """What it says in one line, without the folders in which this machine keeps the file."""
    text = " ".join(str(error).split())
    for folder in (*path.absolute().parents, *path.resolve().parents):
        text = text.replace(f"{folder}/", "") if folder.parts[1:] else text
    return text


def _described(robot: Robot, bare: Robot) -> dict[str, object]:
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


def _compared(found: LookedAt, path: Path, robot: Robot, poses: int, seed: int) -> LookedAt:
    """What Pinocchio and coal say of the same file, in poses drawn within the limits."""
    known = asdict(found)
    q = np.random.default_rng(seed).uniform(*robot.limits.T, size=(poses, len(robot.motors)))
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
        return LookedAt(**known | {"message": _plain(error, path)})
    ours = _contacts(robot, owners, q)
    known |= {"contacts": 0, "other": 0, "deepest_other": 0.0}
    for mine, place in zip(ours, angles, strict=True):
        theirs = peer.touching(place)
        depths = [(mine | theirs)[pair] for pair in mine.keys() ^ theirs.keys()]
        known["contacts"] += len(theirs)
        known["other"] += sum(depth > GRAZE for depth in depths)
        known["deepest_other"] = max(known["deepest_other"], *depths, 0.0)
    return LookedAt(**known)


def _frame_error(robot: Robot, peer: UrdfPeer, q: Array, angles: Array) -> float:
    """Of the frames of all links: those that a joint moves follow its motion, the others are markers."""
    rest = peer.frames(np.zeros(len(robot.joints)))
    worst = 0.0
    for one, place in zip(q, angles, strict=True):
        motion, frames = link_transforms(robot, one), peer.frames(place)
        for index, link in enumerate(robot.links):
            worst = max(worst, float(np.abs(motion[index] @ rest[link] - frames[link]).max()))
        for marker in (one for name, one in robot.markers.items() if name in frames):
            there = np.eye(4)
            there[:3, :3], there[:3, 3] = marker.rotation, marker.position
            worst = max(worst, float(np.abs(motion[marker.link] @ there - frames[marker.name]).max()))
    return worst


def _contacts(robot: Robot, owners: list[str], q: Array) -> list[dict[LinkPair, float]]:
    """For each pose the pairs of links of the URDF that touch, and how deep."""
    table = Model(robot).evaluate(q).table
    found: list[dict[LinkPair, float]] = [{} for _ in q]
    columns = (table.pose, table.first, table.second, table.kind, table.depth)
    for pose, first, second, kind, depth in zip(*(column.tolist() for column in columns), strict=True):
        if kind == 0:
            pair = frozenset((owners[first], owners[second]))
            found[pose][pair] = max(depth, found[pose].get(pair, 0.0))
    return found
