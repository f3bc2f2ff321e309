"""A robot as two flat arrays, one of integers and one of floats, because handing many arrays to compiled code costs more than a pose.

`integers` begins with the header: counts, then where each table starts.  All of them are unsigned: signed indices make Numba emit
the code for counting from the end, which keeps the compiler from vectorising.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mobee.engine.layout import ROW, ROW_BOUND, convex_row, volume_row
from mobee.engine.numba_clusters import clusters
from mobee.kinematics.vectors import cross
from mobee.robot.robot import Array, Ints, LinkPair, Robot, Shape

# Header: counts.
MOTORS, JOINTS, LINKS, SHAPES, DRIVES, CLUSTERS, CLUSTER_PAIRS = range(7)
# Header: starts of integer tables.
I_PARENT, I_KIND, I_MOTOR, I_LINK, I_NAME, I_ROLE, I_WORLD, I_START, I_PAIR, I_BORDER = range(7, 17)
# Header: starts of float tables.
F_SCALE, F_OFFSET, F_ROTATION, F_SHIFT, F_AXIS, F_POINT, F_ROW, F_REACH = range(17, 25)
HEADER = 25

UInts = NDArray[Any]  # of np.uint64, which the type checker would not let meet an int
Flags = NDArray[np.bool_]


@dataclass(frozen=True, slots=True, eq=False)
class Carried:
    """A world object that a link carries, as the engine sees it: a shape of that link."""

    link: int
    row: Array  # (ROW,), in the link's frame


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """What compiled code needs to know of a robot."""

    integers: UInts
    floats: Array
    vertices: Array  # (3 v,) m, of convex shapes, each in its own axes
    order: Ints  # (S,) which shape each packed one is; from len(robot.shapes) on, which carried object


def pack(robot: Robot, carried: Sequence[Carried] = ()) -> Packed:
    """The tables of a robot with what its links carry."""
    rows, vertices = _rows(robot.shapes)
    rows = np.concatenate([rows, *(one.row[None] for one in carried)])
    link = np.array([shape.link for shape in robot.shapes] + [one.link for one in carried], dtype=np.intp)
    role = np.array([int(shape.role == "field") for shape in robot.shapes] + [0] * len(carried), dtype=np.intp)
    tested = _tested(robot, carried)
    groups = clusters(robot, rows, link, role, len(robot.shapes))
    order = np.array([index for group in groups for index in group], dtype=np.intp)
    tested = tested[np.ix_(order, order)]
    starts = np.cumsum([0, *(len(group) for group in groups)])
    pairs = _cluster_pairs(tested, starts)
    bound = rows[order, ROW_BOUND]
    reach = np.where(tested, (bound[:, None] + bound) ** 2, -1.0)
    meets_world = np.array([index not in robot.base_shapes for index in range(len(rows))])
    motor, scale, offset = _drives(robot)
    axis, point = (np.array([getattr(joint, what) for joint in robot.joints]).reshape(-1, 3) for what in ("axis", "point"))
    rotation, shift = _motions(robot, axis, point)
    integers: dict[int, ArrayLike] = {
        I_PARENT: [joint.parent for joint in robot.joints],
        I_KIND: [int(joint.kind == "prismatic") for joint in robot.joints],
        I_MOTOR: motor,
        I_LINK: link[order],
        I_NAME: order,
        I_ROLE: role[order],
        I_WORLD: meets_world[order],
        I_START: starts,
        I_PAIR: pairs,
        I_BORDER: _borders(robot),
    }
    floats: dict[int, ArrayLike] = {
        F_SCALE: scale,
        F_OFFSET: offset,
        F_ROTATION: rotation,
        F_SHIFT: shift,
        F_AXIS: axis,
        F_POINT: point,
        F_ROW: rows[order],
        F_REACH: reach,
    }
    counts = [len(robot.motor_table), len(robot.joints), len(robot.links), len(order), len(motor), len(groups), len(pairs)]
    return _flat(counts, integers, floats, vertices, order)


def _flat(counts: list[int], integers: Mapping[int, ArrayLike], floats: Mapping[int, ArrayLike], vertices: Array, order: Ints) -> Packed:
    header = np.zeros(HEADER, dtype=np.uint64)
    header[: len(counts)] = counts
    whole = [header]
    start = HEADER
    for slot, table in integers.items():
        flat = np.asarray(table, dtype=np.uint64).ravel()
        header[slot] = start
        start += len(flat)
        whole.append(flat)
    real: list[Array] = []
    start = 0
    for slot, table in floats.items():
        values = np.asarray(table, dtype=np.float64).ravel()
        header[slot] = start
        start += len(values)
        real.append(values)
    return Packed(np.concatenate(whole), np.concatenate(real), vertices, order)


def _rows(shapes: Sequence[Shape]) -> tuple[Array, Array]:
    rows, vertices, first = np.zeros((len(shapes), ROW)), [np.zeros((0, 3))], 0
    for index, shape in enumerate(shapes):
        if shape.vertices is None:
            rows[index] = volume_row(shape)
            continue
        rows[index] = convex_row(shape, shape.vertices, first)
        vertices.append(shape.vertices)
        first += len(shape.vertices)
    return rows, np.concatenate(vertices).ravel()


def _tested(robot: Robot, carried: Sequence[Carried]) -> NDArray[np.bool_]:
    """(S, S) symmetric: which two shapes are tested against each other."""
    count = len(robot.shapes)
    tested = np.zeros((count + len(carried),) * 2, dtype=bool)
    for pairs in (robot.solid_pairs, robot.field_pairs):
        tested[pairs[:, 0], pairs[:, 1]] = tested[pairs[:, 1], pairs[:, 0]] = True
    for k, one in enumerate(carried, start=count):
        for index, shape in enumerate(robot.shapes):
            tested[k, index] = tested[index, k] = meets(robot, one.link, shape.link)
        for other, two in enumerate(carried[: k - count], start=count):
            tested[k, other] = tested[other, k] = meets(robot, one.link, two.link)
    return tested


def meets(robot: Robot, link: int, other: int) -> bool:
    """Whether what a link carries is tested against what is on another: never on its own, nor where the robot's links are not."""
    pair: LinkPair = frozenset((link, other))
    return link != other and pair not in robot.untested


def _cluster_pairs(tested: NDArray[np.bool_], starts: Ints) -> Ints:
    pairs = []
    for a in range(len(starts) - 1):
        for b in range(a, len(starts) - 1):
            if tested[starts[a] : starts[a + 1], starts[b] : starts[b + 1]].any():
                pairs.append((a, b))
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)


def _drives(robot: Robot) -> tuple[Ints, Array, Array]:
    """Each joint's motors and their scales, (K, J) with K the largest number of motors on one joint, and its offset (J,)."""
    matrix, offset = robot.coupling
    most = int((matrix != 0.0).sum(axis=1).max(initial=1))
    motor, scale = np.zeros((most, len(offset)), dtype=np.intp), np.zeros((most, len(offset)))
    for joint, row in enumerate(matrix):
        for slot, index in enumerate(np.flatnonzero(row)):
            motor[slot, joint], scale[slot, joint] = index, row[index]
    return motor, scale, offset


def _motions(robot: Robot, axis: Array, point: Array) -> tuple[Array, Array]:
    """A joint's motion is I + sin(a) S + (1 - cos(a)) C: S's and C's rotations as u and u u^T - I, (J, 9), and shifts, (J, 6)."""
    rotation, shift = np.zeros((len(axis), 9)), np.zeros((len(axis), 6))
    across = cross(axis, point)
    for j, joint in enumerate(robot.joints):
        u, p = axis[j], point[j]
        if joint.kind == "prismatic":
            shift[j, :3] = u
            continue
        square = np.outer(u, u) - np.eye(3)
        rotation[j] = *u, square[0, 0], square[1, 1], square[2, 2], square[0, 1], square[0, 2], square[1, 2]
        shift[j, :3], shift[j, 3:] = -across[j], -square @ p
    return rotation, shift


def _borders(robot: Robot) -> list[bool]:
    """For each joint whether the link it moves belongs to another part than the link it is mounted on."""
    matrix, _ = robot.coupling
    part: list[str | None] = [None]
    for j, joint in enumerate(robot.joints):
        driven = np.flatnonzero(matrix[j])
        part.append(robot.motor_table[int(driven[0])].part if driven.size else part[joint.parent])
    return [part[j + 1] != part[joint.parent] for j, joint in enumerate(robot.joints)]
