# SPDX-License-Identifier: Apache-2.0
"""Describes a robot: a tree of joints, parts, motors, markers, constraints, shapes, masses, visuals and cameras.

Axes, points and shapes are those at zero pose, in the root frame. A visual is drawn and has no contacts; it names its mesh, which is read
when it is drawn.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property, wraps
from pathlib import Path
from typing import Any, Literal, TypeVar
from weakref import WeakKeyDictionary

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import UnknownName

ShapeKind = Literal["sphere", "capsule", "cylinder", "box", "convex"]
LinkPair = frozenset[int]
LEVER = 0.5  # m, of the contacts for which the default gains were tuned: the length of the iCub's arm
T = TypeVar("T")
VisualKind = Literal["sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh"]
Channels = tuple[float, float, float, float]  # red, green, blue, opacity in 0..1


@dataclass(frozen=True, slots=True, eq=False)
class Joint:
    """A joint of the tree: its axis in the root frame while every joint is at zero (thesis 2.3.1).

    `parent`: index of the link on which the joint is mounted. Joint j moves link j + 1. `axis`: (3,) unit vector. `point`: (3,) m, a point
    on the axis. `limits`: (2,) rad (revolute) or m (prismatic).
    """

    name: str
    parent: int
    kind: Literal["revolute", "prismatic"]
    axis: Array
    point: Array
    limits: Array


@dataclass(frozen=True, slots=True, eq=False)
class Motor:
    """A motor, which receives commands: it drives one or more joints affinely, joint = scale * motor + offset.

    Positions are in rad. For a motor that drives a prismatic joint with scale 1, as in a URDF, they are in m, and torques are forces in N.
    `part`: name of its part. `limits`: (2,) rad. `home`: position at home, rad. `joints`: (index, scale, offset) of each driven joint.
    `max_velocity` (rad/s; the gate, which checks commands, enforces it), `max_acceleration` (rad/s^2), `max_torque` (N m).

    `zone_ends_at_home`: matters only if the home position is in a limit zone. A limit zone is a range near a limit, in which the control
    law pushes inward. True: the zone ends at home, so that the robot rests there. False: the law pushes the motor away from home. It is
    True for motors of a URDF or MJCF file.
    """

    name: str
    part: str
    limits: Array
    home: float
    joints: tuple[tuple[int, float, float], ...]
    max_velocity: float = np.deg2rad(60.0)
    max_acceleration: float = np.deg2rad(600.0)
    max_torque: float = 40.0
    zone_ends_at_home: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A body part: motors that are commanded together, a contiguous slice of the robot's motor vector.

    `motors`: their names. `start`: index of the first of them in the motor vector.
    """

    name: str
    motors: tuple[str, ...]
    start: int

    @property
    def slice(self) -> slice:
        """The part's motors as a slice of the robot's motor vector."""
        return slice(self.start, self.start + len(self.motors))

    def __len__(self) -> int:
        return len(self.motors)


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """A volume on a link: a solid, or a field, a larger volume that is not solid but causes a repulsive force.

    `link`: index of its link. `part`: name of its part. `role`: "solid" or "field".
    `size` in m: sphere (r,); capsule and cylinder (r, height along local z; a capsule's caps are beyond it); box (x, y, z), full
    edges; convex (): the shape is the hull of `vertices`, (v, 3) m relative to `position`, along the shape's own axes.
    `position` (3,) m, `rotation` (3, 3): in the root frame, at zero pose.
    """

    name: str
    link: int
    kind: ShapeKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    role: Literal["solid", "field"]
    part: str
    vertices: Array | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Marker:
    """A named point on a link, with an orientation and a normal.

    `link`: index of the link. `position` (3,) m, `rotation` (3, 3), `normal` (3,) unit vector: in the root frame, at zero pose.
    """

    name: str
    link: int
    position: Array
    rotation: Array
    normal: Array


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """The mass of a link.

    `link`: index of the link. `mass`: kg. `centre`: (3,) m, centre of mass, root frame, zero pose. `inertia`: (3, 3) kg m^2 about the
    centre, along the axes of the root frame at zero pose; None if unknown.
    """

    link: int
    mass: float
    centre: Array
    inertia: Array | None = None


@dataclass(frozen=True, slots=True)
class MeshSource:
    """The file of a mesh, as a robot's file names it.

    `file`: the name of the mesh's file, a path relative to the robot's file or an address file:// or package://. `name`: name of one mesh
    in a file with several meshes (MJCF). `robot_file`, `line`: where the robot's file names the mesh. `scale`: factors (x, y, z) by which
    the lengths in the mesh's file are multiplied.
    """

    file: str
    robot_file: Path
    line: int = 1
    name: str = ""
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Visual:
    """A volume or a mesh that is drawn on a link and has no contacts.

    `link`: index of the link. `size` in m, as in `mobee.robot.robot.Shape`: sphere (radius,); capsule and cylinder (radius, height); box
    (x, y, z), full edges; ellipsoid (x, y, z), half axes; mesh (). `position` (3,) m, `rotation` (3, 3): in the root frame, at zero pose.
    `color`: red, green, blue and opacity, each 0 to 1; None: the robot's file gives no colour, and a mesh is drawn in the colours of its
    own file. `mesh`: the file of a visual of kind "mesh", else None.
    """

    link: int
    kind: VisualKind
    size: tuple[float, ...]
    position: Array
    rotation: Array
    color: Channels | None = None
    mesh: MeshSource | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """A camera on a link.

    `link`: index of the link. `position` (3,) m, `rotation` (3, 3): in the root frame, at zero pose. The columns of `rotation` are the
    directions right and down of the picture and the direction of view. `view_deg`: vertical field of view, degrees. `hidden`: indices of
    links that are not drawn in the camera's pictures, because they enclose the camera.
    """

    name: str
    link: int
    position: Array
    rotation: Array
    view_deg: float
    hidden: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True, eq=False)
class Clause:
    """A condition on motor positions q [rad or m]: a.q + b > 0 must hold for at least one of its rows (thesis eqs. 5.14 to 5.17).

    All clauses of a robot should hold. `part`: name of the part whose motors it limits. `a`: (rows, n) factors. `b`: (rows,) rad, or m in
    a row whose motors are all in m.
    """

    part: str
    a: Array
    b: Array


@dataclass(frozen=True, eq=False)
class Robot:
    """A kinematic tree with everything that the model, the controller and the agents need.

    Attributes:
        name: the name of the robot.
        links: the names of the links; link 0 is the fixed base.
        joints: the joints; joint j moves link j + 1.
        motor_table: the motors, in the order of q.
        parts: the parts by name. `part(name)` returns one, or raises UnknownName with the nearest name.
        markers: the markers by name. `marker(name)` returns one, or raises UnknownName with the nearest name.
        shapes: solids and fields of all links; a field is a volume that causes a repulsive force.
        clauses: conditions on motor positions, all of which should hold.
        field_pairs, solid_pairs: (p, 2) indices into `shapes`: the pairs of fields, and of solids, that are tested for contacts.
        base_shapes: indices of shapes that are never tested against world objects, since the robot stands on world objects.
        untested: the pairs of links that are never tested for contacts, as sets of two link indices, each with the reason.
        where: file and line of every element, as {("joint", name): "file:line"}.
        bodies: the masses, at most one for each link, in the order of the links; () if the file has none.
        visuals: the drawn surfaces of the links, if these are not their solids.
        cameras: the cameras in the robot's file, by name; `mobee.robot.cameras.cameras_of` chooses which ones make pictures.
        least_lever: m. A contact of fields pushes the motors along J^T (thesis eq. 5.11). J contains the derivatives of the contact's
            depth with respect to the motor positions; the norm |J| is the lever of the contact. 0: the push is proportional to J^T, so a
            contact with a short lever hardly pushes. Above 0: it is proportional to LEVER^2 J^T / (|J|^2 + least_lever^2), with
            LEVER = 0.5 m (`mobee.model.kinematics`).
    """

    name: str
    links: tuple[str, ...]
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
    visuals: tuple[Visual, ...] = ()
    cameras: Mapping[str, Camera] = field(default_factory=dict)
    least_lever: float = 0.0

    def __getstate__(self) -> dict[str, Any]:
        """Copy or pickle the fields alone; the arrays that are computed from them would no longer be read-only."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def motors(self) -> tuple[str, ...]:
        """The names of the motors, in the order of every vector q in this library."""
        return tuple(m.name for m in self.motor_table)

    @cached_property
    def limits(self) -> Array:
        """The lower and upper limit of each motor, (n, 2) rad, or m for a motor of a prismatic joint; read-only."""
        return _fixed(np.array([m.limits for m in self.motor_table]))

    @cached_property
    def home(self) -> Array:
        """The motor positions at home, (n,) rad, or m for a motor of a prismatic joint; read-only."""
        return _fixed(np.array([m.home for m in self.motor_table]))

    @cached_property
    def coupling(self) -> tuple[Array, Array]:
        """The matrix (joints, n) and the offset (joints,) of the map from motors to joints; both read-only.

        Joint positions [rad or m] = matrix @ q + offset.
        """
        matrix = np.zeros((len(self.joints), len(self.motor_table)))
        offset = np.zeros(len(self.joints))
        for column, motor in enumerate(self.motor_table):
            for joint, scale, shift in motor.joints:
                matrix[joint, column] = scale
                offset[joint] = shift
        return _fixed(matrix), _fixed(offset)

    def part(self, name: str) -> Part:
        """Return the part of that name; raises UnknownName with the nearest name."""
        if name not in self.parts:
            raise UnknownName("part", name, self.parts)
        return self.parts[name]

    def motor_index(self, name: str) -> int:
        """Return the index of a motor in q; raises UnknownName with the nearest name."""
        if name not in self.motors:
            raise UnknownName("motor", name, self.motors)
        return self.motors.index(name)

    def marker(self, name: str) -> Marker:
        """Return the marker of that name; raises UnknownName with the nearest name."""
        if name not in self.markers:
            raise UnknownName("marker", name, self.markers)
        return self.markers[name]


def _fixed(array: Array) -> Array:
    """Make an array read-only, since it will be shared."""
    array.flags.writeable = False
    return array


def per_robot(build: Callable[[Robot], T]) -> Callable[[Robot], T]:
    """Return a function that calls `build` once for each robot object and caches the result; callers must not change the result."""
    kept: WeakKeyDictionary[Robot, T] = WeakKeyDictionary()

    @wraps(build)
    def found(robot: Robot) -> T:
        known = kept.get(robot)
        if known is None:
            known = kept[robot] = build(robot)
        return known

    return found
