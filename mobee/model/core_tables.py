# SPDX-License-Identifier: Apache-2.0
"""The tables that the compiled core reads: rows of volumes; the joints, shapes and clusters of a robot.

A volume is a sphere, capsule, cylinder, box or convex hull: a shape of a robot, or an object of the world. A cluster is a group of shapes
that share a bounding sphere.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Protocol
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue
from mobee.robot.motor_units import motor_units
from mobee.robot.robot import LinkPair, Robot, Shape, ShapeKind

CODES: dict[ShapeKind, int] = {"sphere": 0, "capsule": 1, "cylinder": 2, "box": 3, "convex": 4}

VOLUME = np.dtype(
    [
        ("kind", np.int64),
        ("position", np.float64, (3,)),
        ("rotation", np.float64, (3, 3)),
        ("half", np.float64, (3,)),
        ("bound", np.float64),
    ]
)
"""The type of a row that describes a volume, `VolumeRow` of core/robot.hpp.  `kind`: 0 sphere, 1 capsule, 2 cylinder, 3 box, 4 convex.
`half` [m]: sphere (r, 0, 0); capsule and cylinder (r, half height, 0); box half edges; convex (first corner in the table of corners,
number of corners, 0).  `bound`: radius [m] of the ball about the position that contains the volume."""

Volumes = NDArray[Any]  # of VOLUME
Flags = NDArray[np.bool_]
_Edges = tuple[NDArray[np.int32], NDArray[np.int32]]

MANY_CORNERS = 32  # of a hull: with more, the core searches the farthest corner along the edges
MAX_CLUSTER_RADIUS = 0.25  # of the robot's own radius; measured: 0.1 and 0.5 make the broad phase a fifth slower
SAMPLED_POSES = 16  # in which the clusters are chosen

_CACHE: WeakKeyDictionary[Robot, list[list[int]]] = WeakKeyDictionary()


class Volume(Protocol):
    """The members that a robot's Shape and a WorldObject have in common."""

    @property
    def kind(self) -> ShapeKind:
        """The kind of volume: "sphere", "capsule", "cylinder", "box" or "convex"."""

    @property
    def size(self) -> tuple[float, ...]:
        """The lengths of the volume [m], as in `mobee.robot.robot.Shape.size`.

        Sphere: radius; capsule and cylinder: radius and height (of a capsule without its caps); box: full edges x, y and z; convex: no
        lengths.
        """

    @property
    def position(self) -> Array:
        """The position of the volume, (3,) m, in the root frame; that of a volume on a link is given for zero pose."""

    @property
    def rotation(self) -> Array:
        """The rotation of the volume, (3, 3), in the root frame; that of a volume on a link is given for zero pose."""


def bound(volume: Volume, vertices: Array | None = None) -> float:
    """Return the radius [m] of the smallest ball centred at a volume's position that contains the volume.

    `vertices`: (v, 3) m, of a convex volume, relative to its position; None for the other kinds.
    """
    if vertices is not None:
        return float(np.sqrt((vertices * vertices).sum(axis=1)).max())
    size = volume.size
    if volume.kind == "box":
        return math.hypot(*size) / 2.0
    radius, half = size[0], size[1] / 2.0 if len(size) > 1 else 0.0
    return math.hypot(radius, half) if volume.kind == "cylinder" else radius + half


def volume_row(volume: Volume) -> Volumes:
    """Return the description of a sphere, capsule, cylinder or box for the core: a 0-dimensional array of the type VOLUME."""
    size = volume.size
    half = [length / 2.0 for length in size] if volume.kind == "box" else [size[0], size[1] / 2.0 if len(size) > 1 else 0.0, 0.0]
    return _row(volume, half, bound(volume))


def convex_row(volume: Volume, vertices: Array, first: int) -> Volumes:
    """Return the description of a convex volume for the core: a 0-dimensional array of the type VOLUME.

    `vertices`: (v, 3) m, relative to the position of the volume, along its own axes. `first`: index of the first vertex in the core's table
    of corners.
    """
    return _row(volume, [first, len(vertices), 0.0], bound(volume, vertices))


def _row(volume: Volume, half: list[float], radius: float) -> Volumes:
    return np.array((CODES[volume.kind], volume.position, volume.rotation, half, radius), dtype=VOLUME)


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A world object that is attached to a link, as a further shape of that link.

    `link`: index of the link. `row`: one row of the dtype VOLUME, in the link's frame (the root frame at zero
    pose).
    """

    link: int
    row: Volumes


@dataclass(frozen=True, slots=True, eq=False)
class RobotTables:
    """The tables of a robot that core/robot.cpp reads: S shapes, sorted by their C clusters; J joints; V corners of convex shapes.

    A cluster is a group of shapes with one bounding sphere. `motors`: number of motors. `own_shapes`: number of shapes that are not carried
    objects. `least_lever`: m; above 0: contacts with a short lever push more strongly, see `mobee.robot.robot.Robot`. Joints: `parent` (J,)
    the link that carries the joint; `slides` (J,) whether it is prismatic; `border` (J,) whether the link that the joint moves belongs to
    another part than `parent`; `axis` (J, 3) and `point` (J, 3) m of the axis, root frame, zero pose; `motor` (K, J) indices of the motors
    that drive the joint, at most K; `scale` (K, J) joint angle per motor angle, 0 in unused entries; `offset` (J,) joint angle while the
    motors are at 0; `travel` (K, J) motion of the joint [rad or m] when the motor moves by its unit (1 rad, or a length for a slide, see
    `mobee.robot.motor_units.motor_units`). Shapes: `volume` (S,) of the dtype VOLUME; `link` (S,) index of its link; `name` (S,) index into
    the robot's shapes, then the carried objects; `field` (S,) whether it is a field, which causes repulsive forces; `meets_world` (S,)
    whether it is tested against free objects; `cluster` (C + 1,) first shape of each cluster; `tested` (S, S) whether two shapes are tested
    against each other. Corners: `corner` (V, 3) m, relative to the position of the shape, along its axes; `edge_start` (V + 1,) index in
    `edge` of the first edge of each corner; `edge`: the corner at the other end, as its index among the corners of the shape.
    """

    motors: int
    own_shapes: int
    parent: Ints
    slides: Flags
    border: Flags
    axis: Array
    point: Array
    motor: Ints
    scale: Array
    offset: Array
    volume: Volumes
    link: Ints
    name: Ints
    field: Flags
    meets_world: Flags
    cluster: Ints
    tested: Flags
    corner: Array
    edge_start: NDArray[np.int32]
    edge: NDArray[np.int32]
    travel: Array
    least_lever: float

    def for_core(self) -> tuple[dict[str, float], dict[str, NDArray[Any]]]:
        """Return the two arguments of `mobee._core.engine.robot`: the scalars by name, and the contiguous arrays by name."""
        integers = ("parent", "slides", "border", "motor", "link", "name", "field", "meets_world", "cluster")
        others = ("axis", "point", "scale", "offset", "volume", "tested", "corner", "edge_start", "edge", "travel")
        arrays = {name: np.ascontiguousarray(getattr(self, name), dtype=np.int64) for name in integers}
        arrays |= {name: np.ascontiguousarray(getattr(self, name)) for name in others}
        numbers = {
            "motors": self.motors,
            "joints": len(self.parent),
            "drives": len(self.motor),
            "shapes": len(self.volume),
            "own_shapes": self.own_shapes,
            "clusters": len(self.cluster) - 1,
            "corners": len(self.corner),
            "edges": len(self.edge),
            "least_lever": self.least_lever,
        }
        return numbers, arrays


def robot_tables(robot: Robot, carried: Sequence[Carried] = ()) -> RobotTables:
    """Return the tables of a robot that the compiled core reads, with the objects attached to its links as further shapes.

    Raises InvalidValue if an index in the robot (parent of a joint, link of a shape or marker) is out of range. `carried`: the attached
    objects.
    """
    _check(robot)
    rows, corner, edges = _rows(robot.shapes)
    rows = np.concatenate([rows, *(one.row.reshape(1) for one in carried)])
    link = np.array([shape.link for shape in robot.shapes] + [one.link for one in carried], dtype=np.intp)
    field = np.array([shape.role == "field" for shape in robot.shapes] + [False] * len(carried), dtype=np.bool_)
    groups = clusters(robot, rows, link, field, len(robot.shapes))
    order = np.array([index for group in groups for index in group], dtype=np.intp)
    motor, scale, offset = _drives(robot)
    axis, point = (np.array([getattr(joint, what) for joint in robot.joints], dtype=float).reshape(-1, 3) for what in ("axis", "point"))
    return RobotTables(
        motors=len(robot.motor_table),
        own_shapes=len(robot.shapes),
        parent=np.array([joint.parent for joint in robot.joints], dtype=np.intp),
        slides=np.array([joint.kind == "prismatic" for joint in robot.joints], dtype=np.bool_),
        border=_borders(robot),
        axis=axis,
        point=point,
        motor=motor,
        scale=scale,
        offset=offset,
        volume=rows[order],
        link=link[order],
        name=order,
        field=field[order],
        meets_world=np.array([index not in robot.base_shapes for index in order], dtype=np.bool_),
        cluster=np.cumsum([0, *(len(group) for group in groups)]),
        tested=_tested(robot, carried)[np.ix_(order, order)],
        corner=corner,
        edge_start=edges[0],
        edge=edges[1],
        travel=scale * motor_units(robot)[motor],
        least_lever=robot.least_lever,
    )


def _check(robot: Robot) -> None:
    """Raise InvalidValue for indices that the core would follow without a check."""
    for index, joint in enumerate(robot.joints):
        if not 0 <= joint.parent <= index:
            raise InvalidValue(f"joint {joint.name!r} of {robot.name!r} is mounted on link {joint.parent}; it must be one of 0 to {index}.")
    for shape in robot.shapes:
        if not 0 <= shape.link < len(robot.links):
            raise InvalidValue(
                f"shape {shape.name!r} of {robot.name!r} is on link {shape.link}; it must be one of 0 to {len(robot.links) - 1}."
            )
    for marker in robot.markers.values():
        if not 0 <= marker.link < len(robot.links):
            raise InvalidValue(
                f"marker {marker.name!r} of {robot.name!r} is on link {marker.link}; it must be one of 0 to {len(robot.links) - 1}."
            )
    if len(robot.links) != len(robot.joints) + 1:
        raise InvalidValue(
            f"{robot.name!r} has {len(robot.links)} links and {len(robot.joints)} joints; each joint moves a link but the first."
        )


def _rows(shapes: Sequence[Shape]) -> tuple[Volumes, Array, _Edges]:
    rows, corners, edges, first = np.zeros(len(shapes), dtype=VOLUME), [np.zeros((0, 3))], list[list[int]](), 0
    for index, shape in enumerate(shapes):
        if shape.vertices is None:
            rows[index] = volume_row(shape)
            continue
        own, joined = _hull(np.asarray(shape.vertices, dtype=np.float64).tobytes())
        rows[index] = convex_row(shape, own, first)
        corners.append(own)
        edges += joined
        first += len(own)
    starts = np.cumsum([0, *(len(joined) for joined in edges)], dtype=np.int32)
    return rows, np.concatenate(corners), (starts, np.array([other for joined in edges for other in joined], dtype=np.int32))


@lru_cache(maxsize=1024)
def _hull(points: bytes) -> tuple[Array, list[list[int]]]:
    """Return the corners (v, 3) of the hull of points, given as the bytes of (n, 3), and for each the corners that an edge joins it to.

    Few points, and points in a plane, are returned as they are, without edges. Results are kept, since variants of a robot share shapes.
    """
    vertices = np.frombuffer(points).reshape(-1, 3)
    none: tuple[Array, list[list[int]]] = vertices, [[] for _ in vertices]
    if len(vertices) <= MANY_CORNERS:
        return none
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError):
        return none
    number = {int(corner): place for place, corner in enumerate(hull.vertices)}
    joined: list[set[int]] = [set() for _ in number]
    for a, b, c in hull.simplices.tolist():
        for one, other in ((a, b), (b, c), (c, a)):
            joined[number[one]].add(number[other])
            joined[number[other]].add(number[one])
    return vertices[hull.vertices], [sorted(others) for others in joined]


def _tested(robot: Robot, carried: Sequence[Carried]) -> Flags:
    count = len(robot.shapes)
    tested = np.zeros((count + len(carried),) * 2, dtype=np.bool_)
    for pairs in (robot.solid_pairs, robot.field_pairs):
        tested[pairs[:, 0], pairs[:, 1]] = tested[pairs[:, 1], pairs[:, 0]] = True
    for k, one in enumerate(carried, start=count):
        for index, shape in enumerate(robot.shapes):
            tested[k, index] = tested[index, k] = meets(robot, one.link, shape.link)
        for other, two in enumerate(carried[: k - count], start=count):
            tested[k, other] = tested[other, k] = meets(robot, one.link, two.link)
    return tested


def meets(robot: Robot, link: int, other: int) -> bool:
    """Return whether an object that is attached to `link` is tested for contacts with the link `other` (indices).

    It is tested if the two links are different, and the pair of links is not in `robot.untested`.
    """
    pair: LinkPair = frozenset((link, other))
    return link != other and pair not in robot.untested


def _drives(robot: Robot) -> tuple[Ints, Array, Array]:
    matrix, offset = robot.coupling
    most = int((matrix != 0.0).sum(axis=1).max(initial=1))
    motor, scale = np.zeros((most, len(offset)), dtype=np.intp), np.zeros((most, len(offset)))
    for joint, row in enumerate(matrix):
        for slot, index in enumerate(np.flatnonzero(row)):
            motor[slot, joint], scale[slot, joint] = index, row[index]
    return motor, scale, offset


def _borders(robot: Robot) -> Flags:
    matrix, _ = robot.coupling
    part: list[str | None] = [None]
    for j, joint in enumerate(robot.joints):
        driven = np.flatnonzero(matrix[j])
        part.append(robot.motor_table[int(driven[0])].part if driven.size else part[joint.parent])
    return np.array([part[j + 1] != part[joint.parent] for j, joint in enumerate(robot.joints)], dtype=np.bool_)


def clusters(robot: Robot, rows: Volumes, link: Ints, field: Flags, own: int) -> list[list[int]]:
    """Return the clusters of shapes that share a bounding sphere in the core, each a list of indices of shapes.

    `rows`: (S,) the shapes, of the dtype VOLUME. `link`: (S,) index of the link of each shape. `field`: (S,)
    whether it is a field (a shape that causes repulsive forces). `own`: number of the robot's own shapes; the shapes after them are carried
    objects, each of which is a separate cluster.
    """
    groups = _CACHE.get(robot)  # carried objects change while the robot moves, its own groups never do
    if groups is None:
        groups = _CACHE[robot] = _own_clusters(robot, rows[:own], link[:own], field[:own])
    return groups + [[index] for index in range(own, len(rows))]


def _own_clusters(robot: Robot, rows: Volumes, link: Ints, field: Flags) -> list[list[int]]:
    centers = _sampled_centers(robot, rows, link)
    groups: list[list[int]] = []
    for kind in (False, True):
        members = [[int(i) for i in np.flatnonzero((link == k) & (field == kind))] for k in range(len(robot.links))]
        groups += _merge(robot, members, centers, rows["bound"])
    return [sorted(group, key=lambda index: rows["kind"][index]) for group in groups]  # equal kinds side by side help the branch prediction


def _merge(robot: Robot, members: list[list[int]], centers: Array, bound: Array) -> list[list[int]]:
    """Merge every link, leaves first, into the group of its parent link where the two together are small."""
    present = [i for group in members for i in group]
    if not present:
        return []
    limit = MAX_CLUSTER_RADIUS * _radius(centers, bound, present)
    groups = [list(group) for group in members]
    for joint in range(len(robot.joints) - 1, -1, -1):
        parent, child = robot.joints[joint].parent, joint + 1
        if not groups[child]:
            continue
        if not groups[parent] or _radius(centers, bound, groups[parent] + groups[child]) < limit:
            groups[parent], groups[child] = groups[parent] + groups[child], []
    return [group for group in groups if group]


def _radius(centers: Array, bound: Array, group: list[int]) -> float:
    """Return the radius [m] of the sphere around a group of shapes, averaged over the sampled poses.

    The centre of the sphere is the mean of the shapes' positions. `centers`: (poses, S, 3) m. `bound`: (S,) m, radius of each shape around
    its own position. `group`: indices of the shapes.
    """
    inside = centers[:, group]
    between = inside - inside.mean(axis=1, keepdims=True)
    return float((np.sqrt((between * between).sum(axis=2)) + bound[group]).max(axis=1).mean())


def _sampled_centers(robot: Robot, rows: Volumes, link: Ints) -> Array:
    """Return the positions of the shapes in random poses, (SAMPLED_POSES, S, 3)."""
    rng = np.random.default_rng(0)
    low, high = np.clip(robot.limits, -10.0, 10.0).T  # rad; some joints have no limits
    matrix, offset = robot.coupling
    angles = rng.uniform(low, high, (SAMPLED_POSES, len(low))) @ matrix.T + offset
    turn, shift = [np.broadcast_to(np.eye(3), (SAMPLED_POSES, 3, 3))], [np.zeros((SAMPLED_POSES, 3))]
    for j, joint in enumerate(robot.joints):
        carrier_turn, carrier_shift = turn[joint.parent], shift[joint.parent]
        if joint.kind == "prismatic":
            turn.append(carrier_turn)
            shift.append(carrier_shift + (carrier_turn @ joint.axis) * angles[:, j, None])
            continue
        u = joint.axis
        skew = np.array([[0.0, -u[2], u[1]], [u[2], 0.0, -u[0]], [-u[1], u[0], 0.0]])
        s, c = np.sin(angles[:, j, None, None]), 1.0 - np.cos(angles[:, j, None, None])
        own = np.eye(3) + s * skew + c * (skew @ skew)
        turn.append(carrier_turn @ own)
        shift.append((carrier_turn @ (joint.point - own @ joint.point)[:, :, None])[:, :, 0] + carrier_shift)
    turns, shifts = np.stack(turn, axis=1)[:, link], np.stack(shift, axis=1)[:, link]
    placed: Array = (turns @ rows["position"][:, :, None])[..., 0] + shifts
    return placed
