# SPDX-License-Identifier: Apache-2.0
"""Robots, worlds and poses that benchmarks measure: an iCub-like upper body among boxes, and random robots of other makers.

The upper body and its boxes are in data/bench_model.json.  The robots of other makers have the collision volumes that a URDF usually has.
Each has a trunk (3 joints) on the base, two arms (7 joints each) and a neck (2 joints) on the trunk, and two legs (6 joints each) on the
base.  These are 31 joints with one motor each.  Every link has two volumes.  Two links are not tested against each other if one is mounted
on the other, if both are mounted on the same link, or if a single link is between them, as in most SRDFs.
"""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, Literal

import numpy as np

import mobee
from mobee.arrays import Array
from mobee.model.world import World
from mobee.model.world_object import Geometry
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape, ShapeKind

POSE_SEED = 2014
MAKER_SEED = 2026
ICUB = "iCub"
OBJECTS = 100  # around a robot of another maker
CORNERS = 64  # of a hull
_FILE = Path(__file__).with_name("data") / "bench_model.json"
_LIMBS = ((0, 3, (0.0, 0.0, 0.15)), (3, 7, (0.0, 0.2, 0.1)), (3, 7, (0.0, -0.2, 0.1)), (3, 2, (0.0, 0.0, 0.25)))
_LEGS = ((0, 6, (0.0, 0.1, -0.1)), (0, 6, (0.0, -0.1, -0.1)))  # parent link, joints, m from the parent to the first
_LIMIT = 1.5  # rad
_VOLUME_SCALE = 1.6  # of the robot's volumes, in sizes of the objects around it


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot in a world, and poses `q` (B, n) rad of its motors."""

    name: str
    robot: Robot
    world: World
    q: Array


@cache
def upper_body(role: Literal["field", "solid"] = "field", primitives: int | None = None) -> Robot:
    """Return the benchmark's upper body of 41 motors, which is like the iCub's.

    Pairs of a shape of the base and a world object are not tested, because neither the base nor the world moves.

    Args:
        role: "field": the shapes cause repulsive forces; "solid": they do not.
        primitives: the robot has only this number of shapes, the first ones in the file; None: all 129.
    """
    data = _file_content()
    joints = tuple(_joint_of(entry) for entry in data["joints"])
    motors = tuple(_motor_of(index, entry, data["joints"]) for index, entry in enumerate(data["motors"]))
    shapes = tuple(_shape_of(index, entry, role) for index, entry in enumerate(data["primitives"][:primitives]))
    untested = {frozenset((one + 1, other + 1)): "listed by the benchmark" for one, other in data["excluded_link_pairs"]}
    pairs = np.array(_pairs(shapes, set(untested)), dtype=np.intp).reshape(-1, 2)
    none = np.empty((0, 2), dtype=np.intp)
    return Robot(
        name="bench",
        links=("base", *(joint.name for joint in joints)),
        joints=joints,
        motor_table=motors,
        parts={"body": Part("body", tuple(motor.name for motor in motors), 0)},
        markers={},
        shapes=shapes,
        clauses=(),
        field_pairs=pairs if role == "field" else none,
        solid_pairs=pairs if role == "solid" else none,
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested,
    )


def boxes_world(boxes: int) -> World:
    """Return a world with the first `boxes` (0 to 1000) of a fixed list of random boxes."""
    made = World()
    for index, entry in enumerate(_file_content()["boxes"][:boxes]):
        turn = np.array(entry["R"]).reshape(3, 3)
        made.add(f"box{index}", mobee.box(*(2.0 * half for half in entry["size"])), position=entry["pos"], rotation=turn)
    return made


def upper_body_poses(count: int, seed: int = POSE_SEED) -> Array:
    """Return random poses (count, 41) rad of the upper body, uniform between the motors' limits.

    `seed`: of the draw.
    """
    low, high = upper_body().limits.T
    return np.random.default_rng(seed).uniform(low, high, (count, len(low)))


def upper_body_scene(boxes: int, poses: int) -> Scene:
    """Return the upper body in random poses among boxes.  `boxes`: number of boxes, 0 to 1000.  `poses`: number of poses."""
    return Scene(ICUB, upper_body(), boxes_world(boxes), upper_body_poses(poses))


@dataclass(frozen=True, slots=True)
class Maker:
    """Makes random robots, as examples of robots of other makers, and random worlds and poses for them.

    `kinds`: kinds of the collision volumes of a robot, equally many of each.  `around`: kinds of the objects around it.
    """

    name: str
    kinds: tuple[ShapeKind, ...]
    around: tuple[ShapeKind, ...]

    def robot(self, seed: int = MAKER_SEED) -> Robot:
        """Return the random robot with 31 motors.  All its volumes cause repulsive forces (role "field").

        `seed`: of the draw.
        """
        return _random_robot(self, seed)

    def world(self, objects: int, seed: int = MAKER_SEED) -> World:
        """Return a world with `objects` random objects.  With equal seeds, a smaller world has the first objects of a larger one."""
        rng, made = np.random.default_rng([seed, 1]), World()
        for index in range(objects):
            shape = _random_geometry(rng, self.around[index % len(self.around)])
            place = rng.uniform((-0.8, -0.8, -0.6), (0.8, 0.8, 0.9))
            made.add(f"thing{index}", shape, position=place, rotation=_random_rotation(rng))
        return made

    def poses(self, count: int, seed: int = MAKER_SEED) -> Array:
        """Return random poses (count, 31) rad of the robot, uniform between the motors' limits.

        `seed`: of the draw.
        """
        low, high = self.robot().limits.T
        return np.random.default_rng([seed, 2]).uniform(low, high, (count, len(low)))

    def scene(self, objects: int, poses: int) -> Scene:
        """Return the robot in random poses among objects.  `objects`: number of objects.  `poses`: number of poses."""
        return Scene(self.name, self.robot(), self.world(objects), self.poses(poses))


MIXED = Maker("all primitives", ("sphere", "capsule", "box", "cylinder"), ("sphere", "capsule", "box", "cylinder"))
PLAIN = Maker("boxes, cylinders", ("box", "cylinder"), ("box", "cylinder"))
HULLS = Maker("hulls", ("convex",), ("box", "cylinder"))
MAKERS = (MIXED, PLAIN, HULLS)


@cache
def _file_content() -> dict[str, Any]:
    content: dict[str, Any] = json.loads(_FILE.read_text())
    return content


def _joint_of(entry: dict[str, Any]) -> Joint:
    axis = np.array(entry["axis"])
    return Joint(entry["name"], entry["parent"] + 1, "revolute", axis / np.linalg.norm(axis), np.array(entry["point"]), np.zeros(2))


def _motor_of(index: int, entry: dict[str, Any], joints: list[dict[str, Any]]) -> Motor:
    driven = tuple((number, joint["ratio"], 0.0) for number, joint in enumerate(joints) if joint["motor"] == index)
    return Motor(entry["name"], "body", np.array([entry["lo"], entry["hi"]]), 0.0, driven)


def _shape_of(index: int, entry: dict[str, Any], role: Literal["field", "solid"]) -> Shape:
    kind, given, turn = entry["type"], entry["size"], np.array(entry["R"]).reshape(3, 3)
    size = tuple(2.0 * half for half in given) if kind == "box" else (given[0], *(2.0 * half for half in given[1:]))
    return Shape(f"s{index}", entry["link"] + 1, kind, size, np.array(entry["pos"]), turn, role, "body")


def _pairs(shapes: tuple[Shape, ...], untested: set[frozenset[int]]) -> list[tuple[int, int]]:
    """Return the pairs of shapes, as two indices each, that are tested against each other.

    The shapes of a pair are on two different links.  `untested`: pairs of link numbers that are not tested.
    """
    numbered = itertools.combinations(enumerate(shapes), 2)
    return [(i, j) for (i, a), (j, b) in numbered if a.link != b.link and frozenset((a.link, b.link)) not in untested]


@cache
def _random_robot(maker: Maker, seed: int) -> Robot:
    rng = np.random.default_rng(seed)
    joints = _random_tree(rng)
    kinds = rng.permutation(np.resize(maker.kinds, 2 * (len(joints) + 1))).tolist()
    shapes = tuple(_random_shape(rng, index, kind, joints) for index, kind in enumerate(kinds))
    untested = _adjacent_links(joints)
    names = tuple(f"motor{index}" for index in range(len(joints)))
    limits = np.array([-_LIMIT, _LIMIT])
    return Robot(
        name=maker.name,
        links=("base", *(joint.name for joint in joints)),
        joints=joints,
        motor_table=tuple(Motor(name, "body", limits, 0.0, ((index, 1.0, 0.0),)) for index, name in enumerate(names)),
        parts={"body": Part("body", names, 0)},
        markers={},
        shapes=shapes,
        clauses=(),
        field_pairs=np.array(_pairs(shapes, set(untested)), dtype=np.intp),
        solid_pairs=np.empty((0, 2), dtype=np.intp),
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested,
    )


def _random_tree(rng: np.random.Generator) -> tuple[Joint, ...]:
    joints: list[Joint] = []
    ends = [np.zeros(3)]  # of the links
    for link, count, shift in (*_LIMBS, *_LEGS):
        parent, point = link, ends[link] + shift
        away = np.array(shift) / np.linalg.norm(shift)
        for _ in range(count):
            axis = _normalized(rng.normal(size=3))
            joints.append(Joint(f"link{len(joints) + 1}", parent, "revolute", axis, point, np.array([-_LIMIT, _LIMIT])))
            parent = len(joints)
            point = point + rng.uniform(0.06, 0.14) * _normalized(away + 0.3 * rng.normal(size=3))
            ends.append(point)
    return tuple(joints)


def _random_shape(rng: np.random.Generator, index: int, kind: ShapeKind, joints: tuple[Joint, ...]) -> Shape:
    link = index // 2
    place = (joints[link - 1].point if link else np.zeros(3)) + rng.uniform(-0.04, 0.04, 3)
    if kind == "convex":
        corners = _normalized(rng.normal(size=(CORNERS, 3))) * rng.uniform(0.02, 0.06, 3) * _VOLUME_SCALE
        return Shape(f"shape{index}", link, kind, (), place, _random_rotation(rng), "field", "body", corners)
    return Shape(
        f"shape{index}", link, kind, _random_geometry(rng, kind, _VOLUME_SCALE).size, place, _random_rotation(rng), "field", "body"
    )


def _random_geometry(rng: np.random.Generator, kind: ShapeKind, scale: float = 1.0) -> Geometry:
    if kind == "box":
        return mobee.box(*(scale * rng.uniform(0.04, 0.12, 3)))
    if kind == "sphere":
        return mobee.sphere(scale * rng.uniform(0.025, 0.06))
    return (mobee.capsule if kind == "capsule" else mobee.cylinder)(scale * rng.uniform(0.02, 0.05), scale * rng.uniform(0.04, 0.14))


def _adjacent_links(joints: tuple[Joint, ...]) -> dict[frozenset[int], str]:
    """Return the pairs of links that are mounted on each other or on the same link, with the reason why they are not tested."""
    adjacent = {frozenset((joint.parent, index + 1)): "mounted on each other" for index, joint in enumerate(joints)}
    for (i, one), (j, other) in itertools.combinations(enumerate(joints, 1), 2):
        if one.parent == other.parent:
            adjacent[frozenset((i, j))] = "mounted on the same link"
        elif joints[other.parent - 1].parent == i and other.parent:
            adjacent[frozenset((i, j))] = "mounted two joints on"
    return adjacent


def _random_rotation(rng: np.random.Generator) -> Array:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    turn: Array = q * np.sign(np.linalg.det(q))
    return turn


def _normalized(vectors: Array) -> Array:
    found: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found
