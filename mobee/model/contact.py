# SPDX-License-Identifier: Apache-2.0
"""Contacts, one by one and as a table, and the world objects that a part touches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core.tables import NUMBERS, REALS, ROW_BYTES
from mobee.arrays import Array
from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from mobee.model.pose import Pose

KINDS: tuple[Literal["solid", "field"], ...] = ("solid", "field")

Column = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """An overlap of two shapes of the robot, or of a shape of the robot (`first`) and a world object (`second`).

    Moving `first` by depth * normal separates them.  Root frame.  A link of -1 stands for a free world object; an attached
    one has the link that carries it.
    """

    first: str
    second: str
    kind: Literal["solid", "field"]
    depth: float  # m
    normal: Array  # (3,) unit vector, the direction in which `first` must move
    point: Array  # (3,) m, midway between the two deepest points
    first_link: int
    second_link: int


class ContactTable:
    """c contacts of a batch of poses, one row each, sorted by pose, kind, first and second; fields as in Contact.

    Names are given by index: the robot's shapes, then the world's objects.
    """

    # A table is made for every pose and is often never read: its rows become arrays when they are first read.
    __slots__ = ("_objects", "_rows", "_shapes")

    def __init__(self, shapes: tuple[str, ...], objects: tuple[str, ...], rows: tuple[Column, Array] | bytearray) -> None:
        """`rows`: the arrays `numbers` and `reals`, or both in one block as the core writes them, all numbers first."""
        self._shapes = shapes
        self._objects = objects
        self._rows = rows

    def __len__(self) -> int:
        return len(self.reals)

    def name(self, index: int) -> str:
        """Return the name of the shape or object with an index of `first` or `second`."""
        count = len(self._shapes)
        return self._shapes[index] if index < count else self._objects[index - count]

    @property
    def shapes(self) -> tuple[str, ...]:
        """The names of the robot's shapes."""
        return self._shapes

    @property
    def objects(self) -> tuple[str, ...]:
        """The names of the world's objects."""
        return self._objects

    @property
    def numbers(self) -> Column:
        """(c, 6): pose, kind, first, second, first link, second link."""
        return self._arrays()[0]

    @property
    def reals(self) -> Array:
        """(c, 7): depth [m], normal (3), point (3) [m]."""
        return self._arrays()[1]

    @property
    def pose(self) -> Column:
        """The pose of each contact, (c,): index in the flattened batch."""
        return self.numbers[:, 0]

    @property
    def kind(self) -> Column:
        """The kind of each contact, (c,): index in KINDS."""
        return self.numbers[:, 1]

    @property
    def first(self) -> Column:
        """The first volume of each contact, (c,): an index, see `name`."""
        return self.numbers[:, 2]

    @property
    def second(self) -> Column:
        """The second volume of each contact, (c,): an index, see `name`."""
        return self.numbers[:, 3]

    @property
    def first_link(self) -> Column:
        """The link of each first volume, (c,)."""
        return self.numbers[:, 4]

    @property
    def second_link(self) -> Column:
        """The link of each second volume, -1 for a free world object, (c,)."""
        return self.numbers[:, 5]

    @property
    def depth(self) -> Array:
        """Depths, (c,) m."""
        return self.reals[:, 0]

    @property
    def normal(self) -> Array:
        """Normals, (c, 3) unit vectors."""
        return self.reals[:, 1:4]

    @property
    def point(self) -> Array:
        """Points, (c, 3) m."""
        return self.reals[:, 4:7]

    def contacts(self) -> tuple[Contact, ...]:
        """Return the rows as Contact objects."""
        return tuple(
            Contact(self.name(a), self.name(b), KINDS[kind], depth, real[1:4], real[4:7], link_a, link_b)
            for (_, kind, a, b, link_a, link_b), depth, real in zip(
                self.numbers.tolist(), self.reals[:, 0].tolist(), self.reals, strict=True
            )
        )

    def _arrays(self) -> tuple[Column, Array]:
        rows = self._rows
        if isinstance(rows, bytearray):
            rows = self._rows = _read(rows)
        return rows


def _read(rows: bytearray) -> tuple[Column, Array]:
    """Return the integer columns (c, NUMBERS) and real columns (c, REALS) of contacts, as views of the core's buffer."""
    count = len(rows) // ROW_BYTES
    numbers: Column = np.ndarray((count, NUMBERS), np.int64, rows)
    return numbers, np.ndarray((count, REALS), np.float64, rows, offset=numbers.nbytes)


def touched(pose: Pose) -> dict[str, tuple[str, ...]]:
    """Return for every part the names of the world objects in contact (fields included) with a link that it moves; for one pose."""
    return {part: touched_by(pose, part) for part in pose.robot.parts}


def touched_by(pose: Pose, part: str) -> tuple[str, ...]:
    """Return the sorted names of the world objects in contact (fields included) with a link that the part moves; for one pose."""
    return touched_in(pose.table, links_moved(pose.robot)[part])


def touched_in(table: ContactTable, moved: frozenset[int]) -> tuple[str, ...]:
    """Return the sorted names of the world objects that touch a link of `moved`; `table` holds the contacts of one pose."""
    rows = table.numbers.tolist()
    found = {second for _, _, _, second, first_link, second_link in rows if second_link < 0 and first_link in moved}
    return tuple(sorted(map(table.name, found)))


@lru_cache(maxsize=8)
def links_moved(robot: Robot) -> dict[str, frozenset[int]]:
    """Return for every part the links that its motors move: the driven links and all links that these carry."""
    matrix, _ = robot.coupling
    found: dict[str, frozenset[int]] = {}
    for name, part in robot.parts.items():
        moved: set[int] = set()
        for index, joint in enumerate(robot.joints):
            if joint.parent in moved or matrix[index, part.slice].any():
                moved.add(index + 1)
        found[name] = frozenset(moved)
    return found
