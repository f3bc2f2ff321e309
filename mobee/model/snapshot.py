# SPDX-License-Identifier: Apache-2.0
"""What an evaluation needs in addition to q: the world as an immutable snapshot, and the hands that reach.

The hand of a marker is the marker's link with all links that it carries. While the marker reaches, contacts of the hand with targets are
ignored. When the robot is at home, the marker may be inside a field (a volume that causes a repulsive force) of a link of the same part
that is nearer to the base. Then contacts of the fields of that link with targets are ignored too; otherwise their forces would keep the
marker away from every target.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray

from mobee.model.volumes import VOLUME, Volumes, volume_row
from mobee.model.world_object import Role, WorldObject

OBSTACLE, TARGET, GHOST, ATTACHED, ATTACHED_GHOST = range(5)
_FREE: dict[Role, int] = {"obstacle": OBSTACLE, "target": TARGET, "ghost": GHOST}
_CARRIED: dict[Role, int] = {"obstacle": ATTACHED, "target": ATTACHED, "ghost": ATTACHED_GHOST}


@dataclass(frozen=True, slots=True, eq=False)
class Snapshot:
    """An immutable state of the world; each edit of the world makes the next snapshot.

    `version`: number of edits. `objects`: the objects by name, in the order in which they were added; `names`, `rows` and `roles` have the
    same order. `rows` (N,): the volumes as rows of VOLUME (`mobee.model.volumes`); those of attached objects are in the frame of their
    link. `roles` (N,): OBSTACLE, TARGET or GHOST (an object that is only drawn); for an attached object ATTACHED, or ATTACHED_GHOST if it
    is a ghost. `attached`: names of the attached objects.
    """

    version: int
    objects: MappingProxyType[str, WorldObject]
    names: tuple[str, ...]
    rows: Volumes  # (N,) VOLUME, contiguous
    roles: NDArray[np.int64]
    attached: tuple[str, ...]


EMPTY = Snapshot(0, MappingProxyType({}), (), np.empty(0, dtype=VOLUME), np.empty(0, dtype=np.int64), ())


def extended(old: Snapshot, new: WorldObject) -> Snapshot:
    """Return the next snapshot: `old` with one more object, `new`, at the end."""
    count, role = len(old.names), _code(new)
    rows, roles = np.empty(count + 1, dtype=VOLUME), np.empty(count + 1, dtype=np.int64)
    rows[:count], rows[count] = old.rows, volume_row(new)
    roles[:count], roles[count] = old.roles, role
    attached = (*old.attached, new.name) if role >= ATTACHED else old.attached
    return Snapshot(old.version + 1, _with(old, new), (*old.names, new.name), rows, roles, attached)


def changed(old: Snapshot, new: WorldObject) -> Snapshot:
    """Return the next snapshot: `old`, in which the object `new` replaces the object with the same name."""
    place, role = old.names.index(new.name), _code(new)
    rows, roles, attached = old.rows.copy(), old.roles, old.attached
    rows[place] = volume_row(new)
    if role != roles[place]:
        roles = roles.copy()
        roles[place] = role
        attached = tuple(old.names[i] for i in np.flatnonzero(roles >= ATTACHED))
    return Snapshot(old.version + 1, _with(old, new), old.names, rows, roles, attached)


def shortened(old: Snapshot, name: str) -> Snapshot:
    """Return the next snapshot: `old` without the object with the given name."""
    place, count = old.names.index(name), len(old.names)
    rows, roles = np.empty(count - 1, dtype=VOLUME), np.empty(count - 1, dtype=np.int64)
    rows[:place], rows[place:] = old.rows[:place], old.rows[place + 1 :]
    roles[:place], roles[place:] = old.roles[:place], old.roles[place + 1 :]
    objects = old.objects.copy()
    del objects[name]
    names = old.names[:place] + old.names[place + 1 :]
    attached = tuple(other for other in old.attached if other != name)
    return Snapshot(old.version + 1, MappingProxyType(objects), names, rows, roles, attached)


def _with(old: Snapshot, new: WorldObject) -> MappingProxyType[str, WorldObject]:
    objects = old.objects.copy()
    objects[new.name] = new
    return MappingProxyType(objects)


def _code(thing: WorldObject) -> int:
    return (_FREE if thing.link is None else _CARRIED)[thing.role]


MAX_HANDS = 2  # hands that may reach at once; as `most_hands` in core/scene.hpp


@dataclass(frozen=True, slots=True)
class Hand:
    """The links of one reaching hand, whose contacts with targets are ignored.

    `link`: index of a link; contacts of its solids and fields, and of those of all links that it carries, are ignored. `fields`: index of a
    link; contacts of its fields only, and of the fields of all links that it carries, are ignored. `fields` is the same link as `link`, or
    an earlier link of the part, nearer to the base. A solid is a volume of the body of a link; a field is a larger volume that causes a
    repulsive force.
    """

    link: int
    fields: int


Hands = tuple[Hand, ...]
NO_HANDS: Hands = ()


@lru_cache(maxsize=64)
def hand_numbers(reaching: Hands) -> tuple[int, ...]:
    """Return four link indices for the compiled core: `link` and `fields` of the first hand, then of the second; -1: no hand.

    The order is that of `Hands` in core/scene.hpp. Raises ValueError for more than two hands.
    """
    found = [number for hand in reaching for number in (hand.link, hand.fields)]
    if len(found) > 2 * MAX_HANDS:
        raise ValueError(f"{len(reaching)} hands reach at once; at most {MAX_HANDS} may")
    return (*found, *[-1] * (2 * MAX_HANDS - len(found)))
