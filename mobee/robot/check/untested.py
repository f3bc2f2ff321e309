"""Which pairs of a robot are never tested, and why."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations

from mobee.robot.robot import Robot

SAME_LINK = "on the same link, which is rigid"
SAME_PART = "fields of the same part"
UNKNOWN = "left out by who made the robot, who gave no reason"


@dataclass(frozen=True, slots=True)
class UntestedGroup:
    """Pairs that are never tested for one reason: names of links, and how many pairs of shapes that leaves out."""

    reason: str
    links: tuple[tuple[str, str], ...]
    solids: int  # pairs of solids
    fields: int  # pairs of fields


def untested_groups(robot: Robot) -> list[UntestedGroup]:
    """All pairs of links with shapes that are never tested against each other, by reason, the largest group first.

    Solids are never tested against fields of the same robot, so such pairs are not listed.
    """
    links: dict[str, set[tuple[int, int]]] = defaultdict(set)
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    for column, (role, tested) in enumerate((("solid", robot.solid_pairs), ("field", robot.field_pairs))):
        done = {frozenset(pair) for pair in tested.tolist()}
        chosen = [index for index, shape in enumerate(robot.shapes) if shape.role == role]
        for i, j in combinations(chosen, 2):
            if frozenset((i, j)) not in done:
                reason = _reason(robot, i, j)
                low, high = sorted((robot.shapes[i].link, robot.shapes[j].link))
                links[reason].add((low, high))
                counts[reason][column] += 1
    groups = [
        UntestedGroup(reason, tuple((robot.links[a], robot.links[b]) for a, b in sorted(pairs)), *counts[reason])
        for reason, pairs in links.items()
    ]
    return sorted(groups, key=lambda group: (-group.solids - group.fields, group.reason))


def _reason(robot: Robot, i: int, j: int) -> str:
    one, other = robot.shapes[i], robot.shapes[j]
    if one.link == other.link:
        return SAME_LINK
    reason = robot.untested.get(frozenset((one.link, other.link)))
    if reason:
        return reason
    return SAME_PART if one.role == "field" and one.part == other.part else UNKNOWN
