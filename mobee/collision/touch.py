"""Which part of the body touches which object of the world."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from mobee.robot.robot import Robot

if TYPE_CHECKING:
    from mobee.collision.contact import ContactTable
    from mobee.pose import Pose


def touched(pose: Pose) -> dict[str, tuple[str, ...]]:
    """For every part, the names of the world objects in contact (fields included) with a link that it moves; one pose."""
    return {part: touched_by(pose, part) for part in pose.robot.parts}


def touched_by(pose: Pose, part: str) -> tuple[str, ...]:
    """The names of the world objects in contact (fields included) with a link that the part moves, in order; one pose."""
    return touched_in(pose.table, links_moved(pose.robot)[part])


def touched_in(table: ContactTable, moved: frozenset[int]) -> tuple[str, ...]:
    """The names of the world objects in contact with these links, in order, from the contacts of one pose."""
    rows = table.numbers.tolist()
    found = {second for _, _, _, second, first_link, second_link in rows if second_link < 0 and first_link in moved}
    return tuple(sorted(map(table.name, found)))


@lru_cache(maxsize=8)
def links_moved(robot: Robot) -> dict[str, frozenset[int]]:
    """For every part, the links that its motors move in the root frame: those they drive and all that are mounted on them."""
    matrix, _ = robot.coupling
    found: dict[str, frozenset[int]] = {}
    for name, part in robot.parts.items():
        moved: set[int] = set()
        for index, joint in enumerate(robot.joints):
            if joint.parent in moved or matrix[index, part.slice].any():
                moved.add(index + 1)
        found[name] = frozenset(moved)
    return found
