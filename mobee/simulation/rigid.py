# SPDX-License-Identifier: Apache-2.0
"""The active motors of a plant, and a robot reduced to the joints, links and shapes that affect the forces on these motors."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Array, Ints
from mobee.errors import InvalidValue, UnknownName
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Joint, Motor, Robot, per_robot


def living(robot: Robot, active: Sequence[str] | None) -> NDArray[np.bool_]:
    """Return whether each motor is active, that is, may move, (n,); `active`: names or patterns of parts and motors; None: all.

    Raises UnknownName for a pattern that matches nothing, and InvalidValue if no motor is active.
    """
    if active is None:
        return np.ones(len(robot.motors), dtype=bool)
    alive = np.zeros(len(robot.motors), dtype=bool)
    for pattern in [active] if isinstance(active, str) else active:
        found = [fnmatchcase(motor.name, pattern) or fnmatchcase(motor.part, pattern) for motor in robot.motor_table]
        if not any(found):
            raise UnknownName("part or motor", pattern, (*robot.parts, *robot.motors))
        alive |= np.array(found)
    if not alive.any():
        raise InvalidValue(f"active={active!r}: at least one part or motor must be active; None means all.")
    return alive


def stiffened(robot: Robot, alive: NDArray[np.bool_], keep_parts: bool = False, solids: bool = True, apart: Sequence[int] = ()) -> Robot:
    """Return a reduced robot in which the joints of inactive motors are fixed at home; it has the same motors, but fewer links.

    Links whose joints no active motor drives are merged into their parents. Contacts that no active motor can change are left out. The
    forces on active motors stay equal up to rounding, and exactly equal if all motors are active. Markers, masses and attached objects are
    left out. Calls with equal arguments return the same object as long as it is in use.

    Args:
        robot: the robot.
        alive: (n,) whether each motor is active.
        keep_parts: whether links of different parts are not merged; this is needed if a contact force acts only on the motors of the part
            that touches (`PlantSettings.propagate` "part").
        solids: whether solids are kept; False: only fields, the volumes that cause repulsive forces, are kept.
        apart: indices of further links that are not merged.
    """
    known, key = _known(robot), (alive.tobytes(), keep_parts, solids, tuple(apart))
    found = known.get(key)
    if found is None:
        found = known[key] = _stiffened(robot, alive, keep_parts, solids, apart)
    return found


@per_robot
def without_pairs(robot: Robot) -> Robot:
    """Return the robot without tests for contacts between its own shapes."""
    return replace(robot, solid_pairs=robot.solid_pairs[:0], field_pairs=robot.field_pairs[:0])


@per_robot
def _known(robot: Robot) -> WeakValueDictionary[Hashable, Robot]:
    """Return the cache of `stiffened` for a robot."""
    return WeakValueDictionary()


def _stiffened(robot: Robot, alive: NDArray[np.bool_], keep_parts: bool, solids: bool, apart: Sequence[int]) -> Robot:
    kept = (robot.coupling[0][:, alive] != 0.0).any(axis=1)
    if keep_parts:
        kept |= _borders(robot)
    kept[[link - 1 for link in apart if link > 0]] = True
    brought = _brought(robot, kept)
    link = np.zeros(len(robot.links), dtype=np.intp)  # new number of each link
    joint = np.cumsum(kept) - 1  # and of each joint
    for j, one in enumerate(robot.joints):
        link[j + 1] = joint[j] + 1 if kept[j] else link[one.parent]
    shape, solid_pairs, field_pairs = _shapes(robot, link, solids)
    return replace(
        robot,
        links=(robot.links[0], *(robot.links[j + 1] for j in np.flatnonzero(kept))),
        joints=tuple(_moved_joint(robot.joints[j], brought, link) for j in np.flatnonzero(kept)),
        motor_table=tuple(_driving(motor, kept, joint) for motor in robot.motor_table),
        markers={},
        shapes=tuple(
            replace(
                robot.shapes[i],
                link=int(link[robot.shapes[i].link]),
                position=_at(brought[robot.shapes[i].link], robot.shapes[i].position),
                rotation=brought[robot.shapes[i].link][:3, :3] @ robot.shapes[i].rotation,
            )
            for i in shape
        ),
        field_pairs=field_pairs,
        solid_pairs=solid_pairs,
        base_shapes=frozenset(new for new, i in enumerate(shape) if int(i) in robot.base_shapes or link[robot.shapes[i].link] == 0),
        untested={},
        where={},
        bodies=(),
    )


def _brought(robot: Robot, kept: NDArray[np.bool_]) -> Array:
    """Return the link poses (L, 4, 4) with the kept joints at zero and all other joints at home."""
    still = tuple(_driving(motor, ~kept, np.arange(len(kept))) for motor in robot.motor_table)
    return link_transforms(replace(robot, motor_table=still), robot.home)


def _driving(motor: Motor, kept: NDArray[np.bool_], joint: Ints) -> Motor:
    """Return the motor with only the kept joints, by their new numbers."""
    return replace(motor, joints=tuple((int(joint[j]), scale, offset) for j, scale, offset in motor.joints if kept[j]))


def _moved_joint(joint: Joint, brought: Array, link: Ints) -> Joint:
    carrier = brought[joint.parent]
    return replace(joint, parent=int(link[joint.parent]), axis=carrier[:3, :3] @ joint.axis, point=_at(carrier, joint.point))


def _shapes(robot: Robot, link: Ints, solids: bool) -> tuple[Ints, Ints, Ints]:
    """Return the indices of the shapes that the reduced robot keeps, and the pairs of solids and of fields (p, 2) in it.

    `link`: for each link of the robot the index of the link that replaces it. The pairs contain new numbers, indices in the kept shapes.
    Pairs on one link are left out. Kept are shapes on all links but the base, of the role "field" only unless `solids`, and all shapes in
    the pairs.
    """
    of_shape = np.array([link[shape.link] for shape in robot.shapes], dtype=np.intp)
    solid, fields = (pairs[of_shape[pairs[:, 0]] != of_shape[pairs[:, 1]]] for pairs in (robot.solid_pairs, robot.field_pairs))
    needed = of_shape != 0
    if not solids:
        solid = solid[:0]
        needed &= np.array([shape.role == "field" for shape in robot.shapes], dtype=bool)
    needed[solid.ravel()] = needed[fields.ravel()] = True
    number = np.cumsum(needed) - 1
    return np.flatnonzero(needed), number[solid], number[fields]


def _borders(robot: Robot) -> NDArray[np.bool_]:
    """Return for each joint whether it connects links of different parts."""
    part: list[str | None] = [None]
    for joint, row in zip(robot.joints, robot.coupling[0], strict=True):
        driven = np.flatnonzero(row)
        part.append(robot.motor_table[int(driven[0])].part if driven.size else part[joint.parent])
    return np.array([part[j + 1] != part[joint.parent] for j, joint in enumerate(robot.joints)], dtype=bool)


def _at(transform: Array, point: Array) -> Array:
    moved: Array = transform[:3, :3] @ point + transform[:3, 3]
    return moved
