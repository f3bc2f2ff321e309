"""All volumes of one robot in one state of the world, and the contacts among them in one pose."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from mobee.collision.broad import near_grid, near_pairs
from mobee.collision.contact import Contact
from mobee.collision.narrow import overlaps
from mobee.collision.volumes import Placed, Volumes, place, volumes
from mobee.collision.world import Snapshot
from mobee.errors import UnknownName
from mobee.robot.robot import Array, Ints, Robot

_KINDS: tuple[Literal["solid", "field"], ...] = ("solid", "field")


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """A robot's shapes as arrays and the pairs among them; the same in every world."""

    volumes: Volumes
    pairs: Ints  # (p, 2)
    pair_kind: Ints  # (p,) index into _KINDS
    shape_kind: Ints  # (s,) index into _KINDS
    meets_world: Array  # (s,) bool


def body(robot: Robot) -> Body:
    """The collision tables of a robot."""
    solid, field = (np.asarray(pairs, dtype=np.intp).reshape(-1, 2) for pairs in (robot.solid_pairs, robot.field_pairs))
    return Body(
        volumes=volumes(robot.shapes, [shape.link for shape in robot.shapes]),
        pairs=np.concatenate([solid, field]),
        pair_kind=np.repeat([0, 1], [len(solid), len(field)]),
        shape_kind=np.array([_KINDS.index(shape.role) for shape in robot.shapes], dtype=np.intp),
        meets_world=np.array([i not in robot.base_shapes for i in range(len(robot.shapes))], dtype=bool),
    )


@dataclass(frozen=True, slots=True, eq=False)
class Scene:
    """A robot among the objects of one snapshot; a link that reaches spares the targets.  It never changes."""

    robot: Robot
    body: Body
    volumes: Volumes  # the robot's shapes, then the objects
    names: tuple[str, ...]
    allowed: Array  # (s, w) bool: which shape is tested against which object

    def contacts(self, transforms: Array) -> tuple[Contact, ...]:
        """Every overlap in the pose of `transforms` (L, 4, 4): solids before fields, then by shape, then by object."""
        placed = place(self.volumes, transforms)
        first, second, kind = self._candidates(placed)
        found = overlaps(placed, first, second)
        order = np.lexsort((second, first, kind))
        shapes = self.robot.shapes
        contacts = []
        for i in order[found.depth[order] > 0.0]:
            a, b = int(first[i]), int(second[i])
            links = shapes[a].link, shapes[b].link if b < len(shapes) else -1
            depth = float(found.depth[i])
            contacts.append(Contact(self.names[a], self.names[b], _KINDS[kind[i]], depth, found.normal[i], found.point[i], *links))
        return tuple(contacts)

    def solid_count(self, transforms: Array) -> int:
        """How many solid contacts there are in the pose of `transforms` (L, 4, 4)."""
        placed = place(self.volumes, transforms)
        first, second, kind = self._candidates(placed)
        solid = kind == 0
        return int((overlaps(placed, first[solid], second[solid]).depth > 0.0).sum())

    def _candidates(self, placed: Placed) -> tuple[Ints, Ints, Ints]:
        """First and second volume and kind of the pairs that may touch."""
        own = near_pairs(placed, self.body.pairs)
        first, second, kind = self.body.pairs[own, 0], self.body.pairs[own, 1], self.body.pair_kind[own]
        if not self.allowed.size:
            return first, second, kind
        shape, thing = near_grid(placed, len(self.robot.shapes), self.allowed)
        kinds = np.concatenate([kind, self.body.shape_kind[shape]])
        return np.concatenate([first, shape]), np.concatenate([second, thing]), kinds


def scene(robot: Robot, tables: Body, snapshot: Snapshot, reaching_link: int | None) -> Scene:
    """The robot among the objects of `snapshot`; targets are spared by `reaching_link`, ghosts by everything."""
    things = [thing for thing in snapshot.objects.values() if thing.role != "ghost"]
    links = [0 if thing.link is None else _link(robot, thing.link) for thing in things]
    allowed = np.repeat(tables.meets_world[:, None], len(things), axis=1)
    shape_link = tables.volumes.link
    for column, (thing, link) in enumerate(zip(things, links, strict=True)):
        if thing.link is not None:
            allowed[shape_link == link, column] = False
        if thing.role == "target" and reaching_link is not None:
            allowed[shape_link == reaching_link, column] = False
    names = (*(shape.name for shape in robot.shapes), *(thing.name for thing in things))
    all_volumes = tables.volumes.joined(volumes(things, links)) if things else tables.volumes
    return Scene(robot, tables, all_volumes, names, allowed)


def _link(robot: Robot, name: str) -> int:
    if name not in robot.links:
        raise UnknownName("link", name, robot.links)
    return robot.links.index(name)
