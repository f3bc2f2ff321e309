"""Which volumes of a robot in a world are tested against which: the rules of the model, spelt out pair by pair."""

from __future__ import annotations

import itertools

import numpy as np

from mobee.collision.snapshot import ATTACHED, OBSTACLE, TARGET, Snapshot
from mobee.engine.hands import Hands
from mobee.errors import UnknownName
from mobee.robot.robot import Ints, Robot

SOLID, FIELD = 0, 1


def tested_pairs(robot: Robot, snapshot: Snapshot, reaching: Hands) -> tuple[Ints, Ints, Ints]:
    """First and second volume, the robot's shapes and then the objects, and kind (0 solid, 1 field) of every tested pair.

    Own pairs are the robot's.  A free object meets every shape but those of the base; a target spares the hands that are `reaching`.
    An object on a link meets the shapes of all links that its own is tested against, whatever else such links carry, and the free
    objects, as a solid.  Ghosts meet nothing.  Raises UnknownName for an object on no link of the robot.
    """
    own = [(int(a), int(b), kind) for kind, pairs in ((SOLID, robot.solid_pairs), (FIELD, robot.field_pairs)) for a, b in pairs]
    roles = [FIELD if shape.role == "field" else SOLID for shape in robot.shapes]
    start = len(robot.shapes)
    things = list(enumerate(zip(snapshot.objects.values(), snapshot.roles, strict=True), start))
    free = [(index, role == TARGET) for index, (_, role) in things if role in (OBSTACLE, TARGET)]
    carried = [(index, _link(robot, thing.link)) for index, (thing, role) in things if role == ATTACHED and thing.link is not None]
    bodies = [(index, shape.link, role) for index, (shape, role) in enumerate(zip(robot.shapes, roles, strict=True))]

    with_free = [(index, link, role) for index, link, role in bodies if index not in robot.base_shapes]
    with_free += [(index, link, SOLID) for index, link in carried]
    sparing = [set[int](), set[int]()]  # links, by kind
    for hand in reaching:
        sparing[SOLID] |= _carried(robot, hand.link)
        sparing[FIELD] |= _carried(robot, hand.link) | _carried(robot, hand.fields)
    world = [(a, b, kind) for a, link, kind in with_free for b, is_target in free if not (is_target and link in sparing[kind])]
    load = [(a, b, kind) for a, link, kind in bodies for b, other in carried if _meet(robot, link, other)]
    loads = [(a, b, SOLID) for (a, link), (b, other) in itertools.combinations(carried, 2) if _meet(robot, link, other)]
    first, second, kind = np.array([*own, *world, *load, *loads], dtype=np.intp).reshape(-1, 3).T
    return first, second, kind


def _carried(robot: Robot, link: int) -> set[int]:
    """The link and all that is mounted on it."""
    found = {link}
    for j, joint in enumerate(robot.joints):
        if joint.parent in found:
            found.add(j + 1)
    return found


def _link(robot: Robot, name: str) -> int:
    if name not in robot.links:
        raise UnknownName("link", name, robot.links)
    return robot.links.index(name)


def _meet(robot: Robot, link: int, other: int) -> bool:
    return link != other and frozenset((link, other)) not in robot.untested
