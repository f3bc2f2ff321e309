"""What touches what: one contact, and the contacts of many poses as a table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Array

KINDS: tuple[Literal["solid", "field"], ...] = ("solid", "field")

Column = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """Two volumes that overlap: of the robot's shapes, or a shape of the robot (`first`) and a world object (`second`).

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


@dataclass(frozen=True, slots=True, eq=False, init=False)
class ContactTable:
    """c contacts of a batch of poses, one row each, sorted by pose, kind, first and second; fields as in Contact.

    Names are given by index: the robot's shapes, then the world's objects.
    """

    shapes: tuple[str, ...]
    objects: tuple[str, ...]
    numbers: Column  # (c, 6): pose, kind, first, second, first link, second link
    reals: Array  # (c, 7): depth [m], normal (3), point (3) [m]

    def __init__(self, shapes: tuple[str, ...], objects: tuple[str, ...], numbers: Column, reals: Array) -> None:
        # In half the time of the one that a frozen dataclass gets: a table is made for every pose.
        _set_shapes(self, shapes)
        _set_objects(self, objects)
        _set_numbers(self, numbers)
        _set_reals(self, reals)

    def __len__(self) -> int:
        return len(self.reals)

    def name(self, index: int) -> str:
        """The shape or object that `first` or `second` stands for."""
        count = len(self.shapes)
        return self.shapes[index] if index < count else self.objects[index - count]

    @property
    def pose(self) -> Column:
        """Index into the flattened batch, (c,)."""
        return self.numbers[:, 0]

    @property
    def kind(self) -> Column:
        """Index into KINDS, (c,)."""
        return self.numbers[:, 1]

    @property
    def first(self) -> Column:
        """Index of a name, (c,)."""
        return self.numbers[:, 2]

    @property
    def second(self) -> Column:
        """Index of a name, (c,)."""
        return self.numbers[:, 3]

    @property
    def first_link(self) -> Column:
        """The link that carries the first, (c,)."""
        return self.numbers[:, 4]

    @property
    def second_link(self) -> Column:
        """The link that carries the second, -1 for a free world object, (c,)."""
        return self.numbers[:, 5]

    @property
    def depth(self) -> Array:
        """(c,) m."""
        return self.reals[:, 0]

    @property
    def normal(self) -> Array:
        """(c, 3) unit vectors."""
        return self.reals[:, 1:4]

    @property
    def point(self) -> Array:
        """(c, 3) m."""
        return self.reals[:, 4:7]

    def contacts(self) -> tuple[Contact, ...]:
        """The rows as Contact objects."""
        return tuple(
            Contact(self.name(a), self.name(b), KINDS[kind], depth, real[1:4], real[4:7], link_a, link_b)
            for (_, kind, a, b, link_a, link_b), depth, real in zip(
                self.numbers.tolist(), self.reals[:, 0].tolist(), self.reals, strict=True
            )
        )


_set_shapes, _set_objects, _set_numbers, _set_reals = (getattr(ContactTable, name).__set__ for name in ContactTable.__slots__)
