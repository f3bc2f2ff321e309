"""Which pairs of a robot are never tested, and why."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from itertools import combinations

from mobee.robot.robot import Robot

SAME_LINK = "on the same link, which is rigid"
SAME_PART = "fields of the same part"
SINGLE = "left out singly: other shapes of these links are tested"
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
        met = {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in tested}
        chosen = [index for index, shape in enumerate(robot.shapes) if shape.role == role]
        for i, j in combinations(chosen, 2):
            if frozenset((i, j)) not in done:
                reason = _reason(robot, i, j, met)
                low, high = sorted((robot.shapes[i].link, robot.shapes[j].link))
                links[reason].add((low, high))
                counts[reason][column] += 1
    groups = [
        UntestedGroup(reason, tuple((robot.links[a], robot.links[b]) for a, b in sorted(pairs)), *counts[reason])
        for reason, pairs in links.items()
    ]
    return sorted(groups, key=lambda group: (-group.solids - group.fields, group.reason))


def _reason(robot: Robot, i: int, j: int, met: set[frozenset[int]]) -> str:
    """Why two shapes of one role are not tested; `met`: pairs of links of which some shapes of this role are."""
    one, other = robot.shapes[i], robot.shapes[j]
    links = frozenset((one.link, other.link))
    if one.link == other.link:
        return SAME_LINK
    if links in robot.untested:
        return robot.untested[links]
    if links in met:
        return SINGLE
    return SAME_PART if one.role == "field" and one.part == other.part else UNKNOWN
