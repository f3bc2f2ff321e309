# SPDX-License-Identifier: Apache-2.0
"""Random robots and worlds with every feature of the engine, and their contacts computed pair by pair, without a broad phase."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import mobee
from mobee._core.narrow import Volumes, overlaps
from mobee.arrays import Array, Ints
from mobee.model.engine import NO_HANDS, Hands
from mobee.model.fcl_engine import tested_pairs
from mobee.model.kinematics import link_transforms
from mobee.model.world_object import Role, WorldObject
from mobee.robot.robot import Joint, Motor, Part, Robot, Shape

Rng = np.random.Generator


def rotation(rng: Rng) -> Array:
    """A random rotation; at times one along the axes, where volumes lie parallel."""
    if rng.random() < 0.3:
        return np.eye(3)
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.sign(np.linalg.det(q))


@cache
def loaded(name: str) -> Robot:
    """A shipped robot."""
    return mobee.load_robot(name)


def random_robot(rng: Rng, joints: int, shapes: int) -> Robot:
    """A tree of revolute and prismatic joints, some driven by several motors, and motors of several joints or none."""
    made = []
    for j in range(joints):
        axis = rng.normal(size=3)
        kind = "prismatic" if rng.random() < 0.2 else "revolute"
        limits = np.array([-0.3, 0.3]) if kind == "prismatic" else np.array([-3.0, 3.0])
        made.append(Joint(f"j{j}", int(rng.integers(0, j + 1)), kind, axis / np.linalg.norm(axis), rng.uniform(-0.5, 0.5, 3), limits))
    motors = int(rng.integers(1, max(2, joints + 1)))
    drives: list[list[tuple[int, float, float]]] = [[] for _ in range(motors)]
    for j in range(joints):
        if rng.random() < 0.1:
            continue  # no motor drives it
        offset = float(rng.uniform(-0.5, 0.5))  # of the joint, so all of its motors say the same
        for motor in rng.choice(motors, min(motors, int(rng.integers(1, 4))), replace=False):
            drives[motor].append((j, float(rng.uniform(-1.5, 1.5)), offset))
    split = int(rng.integers(0, motors + 1))
    parts = {"one": (0, split), "two": (split, motors)}
    table = tuple(Motor(f"m{m}", "one" if m < split else "two", np.array([-3.0, 3.0]), 0.0, tuple(drive)) for m, drive in enumerate(drives))
    volumes = tuple(_shape(rng, index, joints + 1) for index in range(shapes))
    links = joints + 1
    untested = {frozenset((a, b)): "by chance" for a in range(links) for b in range(a) if rng.random() < 0.2}
    return Robot(
        name="random",
        links=("base", *(f"link{j}" for j in range(joints))),
        joints=tuple(made),
        motor_table=table,
        parts={name: Part(name, tuple(f"m{m}" for m in range(*span)), span[0]) for name, span in parts.items()},
        markers={},
        shapes=volumes,
        clauses=(),
        field_pairs=_pairs(rng, volumes, "field"),
        solid_pairs=_pairs(rng, volumes, "solid"),
        base_shapes=frozenset(index for index, shape in enumerate(volumes) if shape.link == 0 and rng.random() < 0.7),
        untested=untested,
    )


def _shape(rng: Rng, index: int, links: int) -> Shape:
    kind = ("sphere", "capsule", "cylinder", "box", "convex")[rng.integers(5)]
    size = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "convex": 0}[kind]
    vertices = rng.uniform(-0.2, 0.2, (int(rng.integers(4, 12)), 3)) if kind == "convex" else None
    role = "field" if rng.random() < 0.5 else "solid"
    where = rng.uniform(-0.5, 0.5, 3)
    return Shape(
        f"shape{index}", int(rng.integers(links)), kind, tuple(rng.uniform(0.05, 0.4, size)), where, rotation(rng), role, "one", vertices
    )


def _pairs(rng: Rng, shapes: tuple[Shape, ...], role: str) -> Ints:
    pairs = [
        (a, b)
        for b, two in enumerate(shapes)
        for a, one in enumerate(shapes[:b])
        if one.role == two.role == role and one.link != two.link and rng.random() < 0.8
    ]
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def random_world(rng: Rng, robot: Robot, count: int, scale: float = 1.0) -> mobee.World:
    """Objects of every role: mostly small, some huge, tiny or far away, a few on links."""
    world = mobee.World()
    for index in range(count):
        draw = rng.random()
        factor = 20.0 if draw < 0.02 else 0.01 if draw < 0.1 else 1.0
        where = rng.uniform(-scale, scale, 3) * (1e6 if 0.1 < draw < 0.13 else 1.0)
        role: Role = ("obstacle", "obstacle", "obstacle", "target", "ghost")[rng.integers(5)]
        world.add(f"o{index}", _geometry(rng, factor), position=where, rotation=rotation(rng), role=role)
        if rng.random() < 6.0 / count:
            place = rng.uniform(-0.4, 0.4, 3), rotation(rng)
            world.attach(f"o{index}", robot.links[rng.integers(len(robot.links))], place)
    return world


def _geometry(rng: Rng, factor: float) -> Any:
    x, y, z = (float(v) for v in factor * rng.uniform(0.02, 0.3, 3))
    return (mobee.sphere(x), mobee.capsule(x, y), mobee.cylinder(x, y), mobee.box(x, y, z))[rng.integers(4)]


def plain_contacts(robot: Robot, q: Array, world: mobee.World, reaching: Hands = NO_HANDS) -> tuple[NDArray[np.int64], Array]:
    """Numbers (c, 3), kind, first and second, and reals (c, 7) of one pose, in the order of a contact table."""
    transforms, snapshot = link_transforms(robot, q), world.snapshot
    where = [transforms[shape.link] for shape in robot.shapes]
    for thing in snapshot.objects.values():
        where.append(np.eye(4) if thing.link is None else transforms[robot.links.index(thing.link)])
    first, second, kind = (np.array(column, dtype=np.int64) for column in tested_pairs(robot, snapshot, reaching))
    volumes = solids([*robot.shapes, *snapshot.objects.values()], where)
    depth, touch = overlaps(volumes.taken(first), volumes.taken(second))
    touching = np.flatnonzero(depth > 0.0)
    touching = touching[np.lexsort((second[touching], first[touching], kind[touching]))]
    found = np.column_stack([depth, touch["normal"], touch["point"]])
    return np.stack([kind, first, second], axis=1)[touching], found[touching]


def solids(volumes: list[Shape | WorldObject], transforms: list[Array]) -> Volumes:
    """Shapes and objects, each in the frame of its link at (4, 4), as the core reads them."""
    made = Volumes(len(volumes))
    for at, (volume, transform) in enumerate(zip(volumes, transforms, strict=True)):
        turn, shift = transform[:3, :3], transform[:3, 3]
        half = np.array(volume.size) / (2.0 if volume.kind == "box" else np.array([1.0, 2.0])[: len(volume.size)])
        made.place(at, volume.kind, half, turn @ volume.position + shift, turn @ volume.rotation)
        if isinstance(volume, Shape) and volume.vertices is not None:
            made.hull(at, volume.vertices)
    return made


def posed(rng: Rng, robot: Robot, *shape: int) -> Array:
    """Random poses (*shape, n) within the limits."""
    return rng.uniform(*robot.limits.T, (*shape, len(robot.motors)))
