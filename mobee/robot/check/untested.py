"""Which pairs of a robot are never tested, and why."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import combinations

from mobee.robot.robot import Ints, LinkPair, Robot

SAME_LINK = "on the same link, which is rigid"
SAME_PART = "fields of the same part, which overlap wherever it bends"
SINGLE = "left out singly: other shapes of these links are tested"
OTHER_ROLE = {
    "solid": "solids that an <ignore> or the rule of 2014 leaves out, while fields of these links are tested",
    "field": "fields that an <ignore> or the rule of 2014 leaves out, while solids of these links are tested",
}
UNKNOWN = "left out by an <ignore> of the file, or by who made the robot"


@dataclass(frozen=True, slots=True)
class UntestedGroup:
    """Pairs that are never tested for one reason: names of links, and how many pairs of shapes that leaves out."""

    reason: str
    kind: str  # the reason without what it names: groups of one kind are summed up together
    links: tuple[tuple[str, str], ...]
    solids: int  # pairs of solids
    fields: int  # pairs of fields


def untested_groups(robot: Robot) -> list[UntestedGroup]:
    """All pairs of links with shapes that are never tested against each other, by reason, the largest group first.

    Solids are never tested against fields of the same robot, so such pairs are not listed.
    """
    links: dict[str, set[tuple[int, int]]] = defaultdict(set)
    counts: dict[str, list[int]] = defaultdict(lambda: [0, 0])
    pairs: dict[str, Ints] = {"solid": robot.solid_pairs, "field": robot.field_pairs}
    met = {role: {frozenset((robot.shapes[i].link, robot.shapes[j].link)) for i, j in tested} for role, tested in pairs.items()}
    for column, (role, tested) in enumerate(pairs.items()):
        done = {frozenset(pair) for pair in tested.tolist()}
        chosen = [index for index, shape in enumerate(robot.shapes) if shape.role == role]
        for i, j in combinations(chosen, 2):
            if frozenset((i, j)) not in done:
                reason = _reason(robot, i, j, met)
                low, high = sorted((robot.shapes[i].link, robot.shapes[j].link))
                links[reason].add((low, high))
                counts[reason][column] += 1
    groups = [
        UntestedGroup(reason, _kind(reason), tuple((robot.links[a], robot.links[b]) for a, b in sorted(joined)), *counts[reason])
        for reason, joined in links.items()
    ]
    return sorted(groups, key=lambda group: (-group.solids - group.fields, group.reason))


def _kind(reason: str) -> str:
    """The reason without what it names: "adjacent" of "adjacent: joint elbow"."""
    if reason.startswith("joined at"):
        return "joined at a joint or at joints that are close together"
    return re.split(r": | \(|, line ", reason, maxsplit=1)[0]


def _reason(robot: Robot, i: int, j: int, met: Mapping[str, set[LinkPair]]) -> str:
    """Why two shapes of one role are not tested; `met`: for each role the pairs of links of which some shapes are."""
    one, other = robot.shapes[i], robot.shapes[j]
    links = frozenset((one.link, other.link))
    if one.link == other.link:
        return SAME_LINK
    if links in robot.untested:
        return robot.untested[links]
    if links in met[one.role]:
        return SINGLE
    if one.role == "field" and one.part == other.part:
        return SAME_PART
    return OTHER_ROLE[one.role] if any(links in tested for tested in met.values()) else UNKNOWN
