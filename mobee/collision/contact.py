"""What touches what: one contact, and the contacts of many poses as columns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from mobee.robot.robot import Array, Ints

KINDS: tuple[Literal["solid", "field"], ...] = ("solid", "field")


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


@dataclass(frozen=True, slots=True, eq=False)
class ContactTable:
    """c contacts of a batch of poses, one row each, sorted by pose, kind, first and second; fields as in Contact."""

    names: tuple[str, ...]  # the robot's shapes, then the world's objects
    pose: Ints  # (c,) index into the flattened batch
    kind: Ints  # (c,) index into KINDS
    first: Ints  # (c,) index into names
    second: Ints  # (c,)
    first_link: Ints  # (c,)
    second_link: Ints  # (c,)
    depth: Array  # (c,) m
    normal: Array  # (c, 3)
    point: Array  # (c, 3) m

    def __len__(self) -> int:
        return len(self.depth)

    def contacts(self) -> tuple[Contact, ...]:
        """The rows as Contact objects."""
        rows = zip(self.kind, self.first, self.second, self.depth, self.normal, self.point, self.first_link, self.second_link, strict=True)
        return tuple(
            Contact(self.names[a], self.names[b], KINDS[kind], float(depth), normal, point, int(link_a), int(link_b))
            for kind, a, b, depth, normal, point, link_a, link_b in rows
        )
