"""What a robot is: a tree of joints in zero-position form, parts, motors, markers, constraints, shapes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, wraps
from typing import Literal, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import UnknownName

ShapeKind = Literal["sphere", "capsule", "cylinder", "box", "convex"]
LinkPair = frozenset[int]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """One axis of the tree, given in the root frame with every joint at zero (thesis 2.3.1).

    `parent` is the index of the link it is mounted on; joint j moves link j + 1.
    """

    name: str
    parent: int
    kind: Literal["revolute", "prismatic"]
    axis: Array  # (3,) unit vector, root frame, zero pose
    point: Array  # (3,) m, a point on the axis, root frame, zero pose
    limits: Array  # (2,) rad (revolute) or m (prismatic)


@dataclass(frozen=True, slots=True, eq=False)
class Motor:
    """What is commanded: drives one or more joints affinely, joint = scale * motor + offset.

    A motor counts in rad. That of a prismatic joint counts in m where the scale is 1, as from a URDF: read m for rad and N for N m then.
    `zone_ends_at_home`: where home lies so near to a limit that the limit zone of the control law reaches over it, the zone ends at
    home instead, so that the robot rests there; a motor of a URDF does this, one of a zero-position file is pushed away from home.
    """

    name: str
    part: str
    limits: Array  # (2,) rad
    home: float  # rad
    joints: tuple[tuple[int, float, float], ...]  # (joint index, scale, offset in the joint's unit)
    max_velocity: float = np.deg2rad(60.0)  # rad/s, the last resort that the gate enforces
    max_acceleration: float = np.deg2rad(600.0)  # rad/s^2
    max_torque: float = 40.0  # N m
    zone_ends_at_home: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A body part with its own device: a contiguous slice of the robot's motor vector."""

    name: str
    motors: tuple[str, ...]
    start: int

    @property
    def slice(self) -> slice:
        """Where the part's motors lie in the robot's motor vector."""
        return slice(self.start, self.start + len(self.motors))

    def __len__(self) -> int:
        return len(self.motors)


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A volume on a link: a solid, or a larger field that only generates force.

    `size`: sphere (r,); capsule and cylinder (r, height along local z; a capsule's caps lie beyond it);
    box (x, y, z) full edges; convex (): the hull of `vertices`; all in m.  `position`, `rotation`: root frame, zero pose.
    """

    name: str
    link: int
    kind: ShapeKind
    size: tuple[float, ...]
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    role: Literal["solid", "field"]
    part: str
    vertices: Array | None = None  # (v, 3) m about `position`, in the shape's own axes; convex only


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """A named point with an orientation and a normal on a link (root frame, zero pose)."""

    name: str
    link: int
    position: Array  # (3,) m
    rotation: Array  # (3, 3)
    normal: Array  # (3,) unit vector


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """The mass of a link (root frame, zero pose)."""

    link: int
    mass: float  # kg
    centre: Array  # (3,) m, centre of mass
    inertia: Array | None = None  # (3, 3) kg m^2 about the centre, along the root frame's axes; None where nobody knows it


@dataclass(frozen=True, slots=True, eq=False)
class Clause:
    """A disjunction of linear rows over the motor vector, each satisfied when a.q + b > 0 (thesis 5.14-5.17).

    The clauses of a robot form a conjunction.  Radians: the degrees of the file are converted so that
    a is unchanged and b is in rad.
    """

    part: str
    a: Array  # (rows, n)
    b: Array  # (rows,) rad


@dataclass(frozen=True, eq=False)
class Robot:
    """A kinematic tree with everything the model, the controller and the agents need to know of it.

    `field_pairs` and `solid_pairs` are (p, 2) indices into `shapes`: what is tested against each other.
    `base_shapes` marks shapes that are never tested against world objects (they stand on them).  `untested` says of every two
    links that are never tested against each other why, `where` from which file and line a thing was read: ("joint", its name).
    `bodies` holds at most one a link, in the order of the links; () where the file says nothing of masses.
    """

    name: str
    links: tuple[str, ...]  # link 0 is the fixed base
    joints: tuple[Joint, ...]
    motor_table: tuple[Motor, ...]
    parts: dict[str, Part]
    markers: dict[str, Marker]
    shapes: tuple[Shape, ...]
    clauses: tuple[Clause, ...]
    field_pairs: Ints
    solid_pairs: Ints
    base_shapes: frozenset[int] = field(default_factory=frozenset)
    untested: Mapping[LinkPair, str] = field(default_factory=dict)
    where: Mapping[tuple[str, str], str] = field(default_factory=dict)
    bodies: tuple[Body, ...] = ()

    @cached_property
    def motors(self) -> tuple[str, ...]:
        """Motor names in the order of every q in this library."""
        return tuple(m.name for m in self.motor_table)

    @cached_property
    def limits(self) -> Array:
        """Motor limits, shape (n, 2), in [rad], or [m] of a prismatic joint; read-only."""
        return _fixed(np.array([m.limits for m in self.motor_table]))

    @cached_property
    def home(self) -> Array:
        """Motor positions at home, shape (n,), in [rad], or [m] of a prismatic joint; read-only."""
        return _fixed(np.array([m.home for m in self.motor_table]))

    @cached_property
    def coupling(self) -> tuple[Array, Array]:
        """Joint positions (rad or m) as coupling @ q + offset: shapes (joints, n) and (joints,); read-only."""
        matrix = np.zeros((len(self.joints), len(self.motor_table)))
        offset = np.zeros(len(self.joints))
        for column, motor in enumerate(self.motor_table):
            for joint, scale, shift in motor.joints:
                matrix[joint, column] = scale
                offset[joint] = shift
        return _fixed(matrix), _fixed(offset)

    def part(self, name: str) -> Part:
        """The part of that name; raises UnknownName with the nearest one."""
        if name not in self.parts:
            raise UnknownName("part", name, self.parts)
        return self.parts[name]

    def motor_index(self, name: str) -> int:
        """Where a motor stands in q; raises UnknownName with the nearest one."""
        if name not in self.motors:
            raise UnknownName("motor", name, self.motors)
        return self.motors.index(name)

    def marker(self, name: str) -> Marker:
        """The marker of that name; raises UnknownName with the nearest one."""
        if name not in self.markers:
            raise UnknownName("marker", name, self.markers)
        return self.markers[name]


def _fixed(array: Array) -> Array:
    """The array, which is shared from now on."""
    array.flags.writeable = False
    return array


def per_robot(build: Callable[[Robot], T]) -> Callable[[Robot], T]:
    """Decorate a function of a robot so that it is called once for each robot object; nobody may change what it returned."""
    kept: WeakKeyDictionary[Robot, T] = WeakKeyDictionary()

    @wraps(build)
    def found(robot: Robot) -> T:
        known = kept.get(robot)
        if known is None:
            known = kept[robot] = build(robot)
        return known

    return found
