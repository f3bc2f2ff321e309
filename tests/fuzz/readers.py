# SPDX-License-Identifier: Apache-2.0
"""What a fuzzer feeds: both readers, and what must hold of everything that they accept."""

from __future__ import annotations

import re
import warnings
from pathlib import Path

import numpy as np

from mobee.arrays import Array
from mobee.errors import MobeeError, RobotFileError
from mobee.model.model import Model
from mobee.model.world import World
from mobee.model.world_file import read_world
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import UrdfOptions, read_urdf
from mobee.robot.xml.read import read_robot

FUZZ = Path(__file__).parent
SEEDS = FUZZ / "seeds"
SHIPPED = FUZZ.parents[1] / "mobee" / "robot"
CORPUS = FUZZ.parent / "corpus"
DIVIDER = b"\n%%\n"  # between the files of one input
URDF_FILES = ("given.urdf", "given.srdf", "given.stl", "given.obj", "given.dae")
MOST_SHAPES = 200  # of a robot whose contacts are computed: more would take an input's time
POSES = 3  # besides home
OPTIONS = (UrdfOptions(), UrdfOptions(field=0.03), UrdfOptions(field=0.03, meshes="bounding"))  # taken in turn


def feed_xml(content: bytes, folder: Path) -> bool:
    """Read `content` as a robot and as a world; True if one of them accepts it. Raises all errors except RobotFileError."""
    path = folder / "given.xml"
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            robot = read_robot(path)
            check_robot(robot)
            check_poses(robot, World())
            return True
        except RobotFileError as error:
            check_message(error, folder)
        try:
            check_poses(load_robot("katana"), read_world(path))
            return True
        except RobotFileError as error:
            check_message(error, folder)
    return False


def feed_urdf(content: bytes, folder: Path) -> bool:
    """Read `content`, a URDF and the files beside it, as a robot; True if it is one. Raises all errors except RobotFileError."""
    parts = content.split(DIVIDER)
    for name, part in zip(URDF_FILES, parts, strict=False):
        (folder / name).write_bytes(part)
    for name in URDF_FILES[len(parts) :]:
        (folder / name).unlink(missing_ok=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            robot = read_urdf(folder / URDF_FILES[0], OPTIONS[len(content) % len(OPTIONS)])
            check_robot(robot)
            check_poses(robot, World())
        except RobotFileError as error:
            check_message(error, folder)
            return False
    return True


def check_message(error: RobotFileError, folder: Path) -> None:
    """Raise AssertionError unless a message names a file and is of a length that a person reads."""
    text = str(error)
    named = str(folder) in text or str(SHIPPED) in text
    if not named or len(text) > 4000 or error.args == ():
        raise AssertionError(f"a message without a file, or endless: {text[:300]}")


def check_robot(robot: Robot) -> None:
    """Raise AssertionError unless every number of a robot is finite and every index and name is one that it has."""
    links, joints, shapes = len(robot.links), len(robot.joints), len(robot.shapes)
    numbers = [
        robot.limits,
        robot.home,
        *robot.coupling,
        *(np.concatenate([joint.axis, joint.point, joint.limits]) for joint in robot.joints),
        *(np.concatenate([shape.position, shape.rotation.ravel(), shape.size]) for shape in robot.shapes),
        *(shape.vertices for shape in robot.shapes if shape.vertices is not None),
        *(np.concatenate([m.position, m.rotation.ravel(), m.normal]) for m in robot.markers.values()),
        *(np.concatenate([clause.a.ravel(), clause.b]) for clause in robot.clauses),
    ]
    names = [robot.links, robot.motors, [joint.name for joint in robot.joints], [shape.name for shape in robot.shapes]]
    pairs = [robot.solid_pairs, robot.field_pairs]
    sound = {
        "a number is not finite": all(np.isfinite(values).all() for values in numbers),
        "an axis is no unit vector": all(abs(float(np.linalg.norm(joint.axis)) - 1) < 1e-6 for joint in robot.joints),
        "a tree is none": links == joints + 1 and all(0 <= joint.parent <= index for index, joint in enumerate(robot.joints)),
        "a link does not exist": all(0 <= thing.link < links for thing in (*robot.shapes, *robot.markers.values())),
        "a name stands twice": all(len(set(some)) == len(some) for some in names),
        "a pair does not exist": all(some.ndim == 2 and (not some.size or 0 <= some.min() <= some.max() < shapes) for some in pairs),
        "limits are swapped": all(motor.limits[0] < motor.limits[1] for motor in robot.motor_table),
        "home is outside": all(motor.limits[0] <= motor.home <= motor.limits[1] for motor in robot.motor_table),
        "parts do not follow each other": [name for part in robot.parts.values() for name in robot.motors[part.slice]] == [*robot.motors],
        "a link pair is none": all(len(pair) == 2 and max(pair) < links for pair in robot.untested),
        "a tested pair has a reason": not tested_links(robot) & robot.untested.keys(),
    }
    broken = [what for what, holds in sound.items() if not holds]
    if broken:
        raise AssertionError(f"a robot was accepted although {', '.join(broken)}")


def check_poses(robot: Robot, world: World) -> None:
    """Raise AssertionError unless the contacts of a robot in a world are sound at home and in some poses, or are refused in one line."""
    if len(robot.shapes) > MOST_SHAPES:
        return
    try:
        model = Model(robot, world)
        rng = np.random.default_rng(len(robot.shapes))
        low, high = robot.limits.T
        for q in (robot.home, *(low + rng.random((POSES, len(low))) * (high - low))):
            check_contacts(model, q)
    except MobeeError as error:
        text = str(error)
        if "\n" in text or len(text) > 4000:
            raise AssertionError(f"a message of several lines, or endless: {text[:300]}") from None


def check_contacts(model: Model, q: Array) -> None:
    """Raise AssertionError unless all results of the model for a pose are finite, normals are unit vectors, and depths are not negative."""
    pose = model.evaluate(q)
    normals = pose.table.normal
    sound = {
        "a place is not finite": np.isfinite(pose.transforms).all(),
        "a contact is not finite": np.isfinite(pose.table.reals).all(),
        "a projection is not finite": np.isfinite(pose.projection).all(),
        "a normal is no unit vector": (np.abs((normals**2).sum(axis=1) - 1.0) < 1e-9).all(),
        "a depth is negative": (pose.table.depth >= 0.0).all(),
    }
    broken = [what for what, holds in sound.items() if not holds]
    if broken:
        raise AssertionError(f"of a robot and a world that were accepted, {', '.join(broken)} at {q.tolist()}")


def tested_links(robot: Robot) -> set[frozenset[int]]:
    """Pairs of different links of which any two shapes are tested against each other."""
    pairs = (*robot.solid_pairs.tolist(), *robot.field_pairs.tolist())
    found = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in pairs}
    return {pair for pair in found if len(pair) == 2}


def xml_seeds() -> list[bytes]:
    """Shipped robots and worlds, the corpus, and a robot that has every tag."""
    folders = (SHIPPED / "robots", SHIPPED / "worlds", CORPUS / "robots", CORPUS / "worlds", SEEDS)
    return [path.read_bytes() for folder in folders for path in sorted(folder.glob("*.xml"))]


def urdf_seeds() -> list[bytes]:
    """The corpus, and a robot that has every tag with an SRDF and meshes beside it."""
    full = DIVIDER.join((SEEDS / name.replace("given", "every_tag")).read_bytes() for name in URDF_FILES)
    return [full, *(path.read_bytes() for path in sorted((CORPUS / "urdf").glob("*.urdf")))]


def words(seeds: list[bytes]) -> list[str]:
    """Every tag and attribute of the seeds, for a fuzzer to write in."""
    return sorted({word.decode() for seed in seeds for word in re.findall(rb"(?<=<)[A-Za-z_]+|[A-Za-z_]+(?==\")", seed)})
