"""Robots of other makers, drawn at random: what a URDF's collision volumes usually are, and worlds of the same volumes.

Each is a trunk of three joints with two arms of seven and a neck of two on it, and two legs of six at the base: 31 motors, a joint
each, and two volumes a link.  Links that are mounted on each other or on the same one are not tested, as in most SRDFs.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import cache

import numpy as np

import mobee
from mobee.arrays import Array
from mobee.model.world import World
from mobee.model.world_object import Geometry
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape, ShapeKind

SEED = 2026
OBJECTS = 100
CORNERS = 64  # of a hull
_LIMBS = ((0, 3, (0.0, 0.0, 0.15)), (3, 7, (0.0, 0.2, 0.1)), (3, 7, (0.0, -0.2, 0.1)), (3, 2, (0.0, 0.0, 0.25)))
_LEGS = ((0, 6, (0.0, 0.1, -0.1)), (0, 6, (0.0, -0.1, -0.1)))  # link, joints, m from there to the first
_LIMIT = 1.5  # rad
_BULK = 1.6  # of the robot's volumes, in sizes of the things around it


@dataclass(frozen=True, slots=True)
class Maker:
    """What a robot's volumes are, in equal parts, and those of the things around it."""

    name: str
    kinds: tuple[ShapeKind, ...]
    around: tuple[ShapeKind, ...]


MIXED = Maker("all primitives", ("sphere", "capsule", "box", "cylinder"), ("sphere", "capsule", "box", "cylinder"))
PLAIN = Maker("boxes, cylinders", ("box", "cylinder"), ("box", "cylinder"))
HULLS = Maker("hulls", ("convex",), ("box", "cylinder"))
MAKERS = (MIXED, PLAIN, HULLS)


@cache
def robot(maker: Maker, seed: int = SEED) -> Robot:
    """The robot; all its volumes are fields, so that they make forces."""
    rng = np.random.default_rng(seed)
    joints = _tree(rng)
    kinds = rng.permutation(np.resize(maker.kinds, 2 * (len(joints) + 1))).tolist()
    shapes = tuple(_shape(rng, index, kind, joints) for index, kind in enumerate(kinds))
    untested = _near_links(joints)
    names = tuple(f"motor{index}" for index in range(len(joints)))
    limits = np.array([-_LIMIT, _LIMIT])
    tested = [
        (i, j)
        for (i, a), (j, b) in itertools.combinations(enumerate(shapes), 2)
        if a.link != b.link and frozenset((a.link, b.link)) not in untested
    ]
    return Robot(
        name=maker.name,
        links=("base", *(joint.name for joint in joints)),
        joints=joints,
        motor_table=tuple(Motor(name, "body", limits, 0.0, ((index, 1.0, 0.0),)) for index, name in enumerate(names)),
        parts={"body": Part("body", names, 0)},
        markers={},
        shapes=shapes,
        clauses=(),
        field_pairs=np.array(tested, dtype=np.intp),
        solid_pairs=np.empty((0, 2), dtype=np.intp),
        base_shapes=frozenset(index for index, shape in enumerate(shapes) if shape.link == 0),
        untested=untested,
    )


def world(maker: Maker, objects: int, seed: int = SEED) -> World:
    """The first `objects` of the things around; each number is a prefix of the next."""
    rng, made = np.random.default_rng([seed, 1]), World()
    for index in range(objects):
        shape = _geometry(rng, maker.around[index % len(maker.around)])
        made.add(f"thing{index}", shape, position=rng.uniform((-0.8, -0.8, -0.6), (0.8, 0.8, 0.9)), rotation=_turn(rng))
    return made


def poses(maker: Maker, count: int, seed: int = SEED) -> Array:
    """Random q (count, 31) rad, uniform between the limits."""
    low, high = robot(maker).limits.T
    return np.random.default_rng([seed, 2]).uniform(low, high, (count, len(low)))


def _tree(rng: np.random.Generator) -> tuple[Joint, ...]:
    joints: list[Joint] = []
    ends = [np.zeros(3)]  # of the links
    for link, count, shift in (*_LIMBS, *_LEGS):
        parent, point = link, ends[link] + shift
        away = np.array(shift) / np.linalg.norm(shift)
        for _ in range(count):
            axis = _unit(rng)
            joints.append(Joint(f"link{len(joints) + 1}", parent, "revolute", axis, point, np.array([-_LIMIT, _LIMIT])))
            parent = len(joints)
            point = point + rng.uniform(0.06, 0.14) * _normalized(away + 0.3 * rng.normal(size=3))
            ends.append(point)
    return tuple(joints)


def _shape(rng: np.random.Generator, index: int, kind: ShapeKind, joints: tuple[Joint, ...]) -> Shape:
    link = index // 2
    place = (joints[link - 1].point if link else np.zeros(3)) + rng.uniform(-0.04, 0.04, 3)
    if kind == "convex":
        corners = _normalized(rng.normal(size=(CORNERS, 3))) * rng.uniform(0.02, 0.06, 3) * _BULK
        return Shape(f"shape{index}", link, kind, (), place, _turn(rng), "field", "body", corners)
    return Shape(f"shape{index}", link, kind, _geometry(rng, kind, _BULK).size, place, _turn(rng), "field", "body")


def _geometry(rng: np.random.Generator, kind: ShapeKind, scale: float = 1.0) -> Geometry:
    if kind == "box":
        return mobee.box(*(scale * rng.uniform(0.04, 0.12, 3)))
    if kind == "sphere":
        return mobee.sphere(scale * rng.uniform(0.025, 0.06))
    return (mobee.capsule if kind == "capsule" else mobee.cylinder)(scale * rng.uniform(0.02, 0.05), scale * rng.uniform(0.04, 0.14))


def _near_links(joints: tuple[Joint, ...]) -> dict[frozenset[int], str]:
    """Links that are mounted on each other, or on the same one."""
    near = {frozenset((joint.parent, index + 1)): "mounted on each other" for index, joint in enumerate(joints)}
    for (i, one), (j, other) in itertools.combinations(enumerate(joints, 1), 2):
        if one.parent == other.parent:
            near[frozenset((i, j))] = "mounted on the same link"
        elif joints[other.parent - 1].parent == i and other.parent:
            near[frozenset((i, j))] = "mounted two joints on"
    return near


def _turn(rng: np.random.Generator) -> Array:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    turn: Array = q * np.sign(np.linalg.det(q))
    return turn


def _unit(rng: np.random.Generator) -> Array:
    return _normalized(rng.normal(size=3))


def _normalized(vectors: Array) -> Array:
    found: Array = vectors / np.linalg.norm(vectors, axis=-1, keepdims=True)
    return found
