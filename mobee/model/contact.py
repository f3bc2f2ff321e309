# SPDX-License-Identifier: Apache-2.0
"""Contacts, one by one and as a table, and the world objects that a part touches."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee._core import NUMBERS, REALS, ROW_BYTES
from mobee.arrays import Array
from mobee.robot.robot import Robot

KINDS: tuple[Literal["solid", "field"], ...] = ("solid", "field")

Column = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """An overlap of two volumes, of which at least one is on the robot (a shape or an attached object).

    `first`, `second`: their names; a free world object is always `second`. `kind`: "solid": two solids overlap; "field": at least one of
    the two is a field, a volume that is not solid but causes a repulsive force. Moving `first` by depth * normal separates the two.
    `depth`: m. `normal`: (3,) unit vector, root frame. `point`: (3,) m, root frame, midway between the two deepest points. `first_link`,
    `second_link`: indices of the links of `first` and `second`; the link of an attached object is the link that carries it; -1: a free
    world object.
    """

    first: str
    second: str
    kind: Literal["solid", "field"]
    depth: float
    normal: Array
    point: Array
    first_link: int
    second_link: int


class ContactTable:
    """A table of the contacts in a batch of poses, with one row for each of the c contacts, sorted by pose, kind, first and second.

    The columns are those of `mobee.model.contact.Contact`. Shapes and world objects are numbered: first the robot's shapes, then the
    world's objects; `name` returns the name of a number. `shapes`, `objects`: their names. `rows`: two blocks
    of columns, one of whole and one of real numbers, as arrays or as bytes (see `__init__`).
    """

    # A table is made for every pose and is often never read: its rows become arrays when they are first read.
    __slots__ = ("_objects", "_rows", "_shapes")

    def __init__(self, shapes: tuple[str, ...], objects: tuple[str, ...], rows: tuple[Column, Array] | bytearray) -> None:
        """Make a table from the names of the robot's shapes and of the world's objects, and from the rows.

        `rows`: the arrays `numbers` (c, 6) and `reals` (c, 7), or both in one block of bytes as the core writes them, all numbers first.
        """
        self._shapes = shapes
        self._objects = objects
        self._rows = rows

    def __len__(self) -> int:
        return len(self.reals)

    def name(self, index: int) -> str:
        """Return the name of a shape or world object; `index`: its number, as in the columns `first` and `second`."""
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
        """The integer columns of all contacts, (c, 6): pose, kind, first, second, first link, second link; see these properties."""
        return self._arrays()[0]

    @property
    def reals(self) -> Array:
        """The real columns of all contacts, (c, 7): depth [m], normal (3 columns), point (3 columns, m, root frame)."""
        return self._arrays()[1]

    @property
    def pose(self) -> Column:
        """The pose of each contact, (c,): index of the pose in the batch, flattened to one dimension."""
        return self.numbers[:, 0]

    @property
    def kind(self) -> Column:
        """The kind of each contact, (c,): 0: two solids; 1: a field (a volume that causes a repulsive force) is involved."""
        return self.numbers[:, 1]

    @property
    def first(self) -> Column:
        """The index of the first volume of each contact, (c,), in a list of all shapes, then all objects; an object here is attached."""
        return self.numbers[:, 2]

    @property
    def second(self) -> Column:
        """The index of the second volume of each contact, (c,), in a list of all shapes of the robot, then all world objects."""
        return self.numbers[:, 3]

    @property
    def first_link(self) -> Column:
        """The index of the link of each first volume, (c,), never -1: if that volume is an attached object, the link that carries it."""
        return self.numbers[:, 4]

    @property
    def second_link(self) -> Column:
        """The index of the link of each second volume, (c,); -1 for a free world object."""
        return self.numbers[:, 5]

    @property
    def depth(self) -> Array:
        """The depth of each contact, (c,) m."""
        return self.reals[:, 0]

    @property
    def normal(self) -> Array:
        """The normal of each contact, (c, 3), root frame: the unit vector in whose direction `first` must move to separate the two."""
        return self.reals[:, 1:4]

    @property
    def point(self) -> Array:
        """The point of each contact, (c, 3) m, root frame: midway between the two deepest points."""
        return self.reals[:, 4:7]

    def contacts(self) -> tuple[Contact, ...]:
        """Return the rows of the table as Contact objects, in the same order."""
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


def touched_in(table: ContactTable, moved: frozenset[int]) -> tuple[str, ...]:
    """Return the sorted names of the free world objects that touch one of the links `moved` (indices).

    An object touches a link if it overlaps a solid of the link, a field (a larger volume that causes a repulsive force), or an object that
    is attached to the link. `table`: the contacts of one pose.
    """
    rows = table.numbers.tolist()
    found = {second for _, _, _, second, first_link, second_link in rows if second_link < 0 and first_link in moved}
    return tuple(sorted(map(table.name, found)))


@lru_cache(maxsize=8)
def links_moved(robot: Robot) -> dict[str, frozenset[int]]:
    """Return a dict from every part to the indices of the links that its motors move: the driven links and all links mounted on them."""
    matrix, _ = robot.coupling
    found: dict[str, frozenset[int]] = {}
    for name, part in robot.parts.items():
        moved: set[int] = set()
        for index, joint in enumerate(robot.joints):
            if joint.parent in moved or matrix[index, part.slice].any():
                moved.add(index + 1)
        found[name] = frozenset(moved)
    return found
