"""The tag ignore: pairs of links or shapes, or a whole part, that the file itself leaves out."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from mobee.robot.pairs import link_pairs, merged
from mobee.robot.robot import Ints, LinkPair, Robot
from mobee.robot.xml_node import Node

ROLES = ("solid", "field", "both")
IGNORE_ATTRIBUTES = frozenset({"first", "second", "of", "part", "role", "reason"})


@dataclass(slots=True)
class _Ignored:
    """What the tags of one role name."""

    links: dict[LinkPair, str] = field(default_factory=dict)  # and why
    shapes: set[frozenset[int]] = field(default_factory=set)
    parts: set[str] = field(default_factory=set)


def without_ignored(robot: Robot, nodes: Iterable[Node]) -> Robot:
    """The robot without the pairs that <ignore> tags name; raises RobotFileError for an unknown link, shape, part or role."""
    names = {
        "links": {name: index for index, name in enumerate(robot.links)},
        "shapes": {shape.name: index for index, shape in enumerate(robot.shapes)},
    }
    lines = {role: _Ignored() for role in ROLES}
    for node in nodes:
        ignored = lines[node.choice("role", node.attributes.get("role", "both"), ROLES, "role")]
        if "part" in node.attributes:
            ignored.parts.add(node.choice("part", node.text("part"), robot.parts, "part"))
            continue
        kind = node.choice("of", node.attributes.get("of", "links"), names, "kind")
        first, second = (names[kind][node.choice(end, node.text(end), names[kind], kind[:-1])] for end in ("first", "second"))
        if first == second:
            node.fail("second", f"is the first {kind[:-1]} again", "Name two; shapes of one link are never tested against each other")
        if kind == "shapes":
            ignored.shapes.add(frozenset((first, second)))
        else:
            ignored.links.setdefault(frozenset((first, second)), node.optional("reason") or f"the file says so, line {node.line}")
    return _left(robot, lines)


def _left(robot: Robot, lines: Mapping[str, _Ignored]) -> Robot:
    solid_pairs, field_pairs = robot.solid_pairs, robot.field_pairs
    for role in ("solid", "both"):
        solid_pairs = _kept(robot, solid_pairs, lines[role])
    for role in ("field", "both"):
        field_pairs = _kept(robot, field_pairs, lines[role])
    tested = link_pairs(robot.shapes, field_pairs)
    solids = {pair: reason for pair, reason in lines["solid"].links.items() if pair not in tested}
    untested = merged(robot.untested, lines["both"].links, solids)
    return replace(robot, solid_pairs=solid_pairs, field_pairs=field_pairs, untested=untested)


def _kept(robot: Robot, pairs: Ints, ignored: _Ignored) -> Ints:
    if not len(pairs):
        return pairs
    link = np.array([shape.link for shape in robot.shapes], dtype=np.intp)
    table = _table(len(robot.links), ignored.links)
    between = table[link[pairs[:, 0]], link[pairs[:, 1]]]
    between |= _table(len(robot.shapes), ignored.shapes)[pairs[:, 0], pairs[:, 1]]
    part = np.array([shape.part for shape in robot.shapes])
    inside = np.isin(part, sorted(ignored.parts)) if ignored.parts else np.zeros(len(part), dtype=bool)
    between |= inside[pairs[:, 0]] & (part[pairs[:, 0]] == part[pairs[:, 1]])
    return pairs[~between]


def _table(count: int, pairs: Collection[frozenset[int]]) -> np.ndarray[tuple[int, int], np.dtype[np.bool_]]:
    table = np.zeros((count, count), dtype=bool)
    for pair in pairs:
        a, b = pair
        table[a, b] = table[b, a] = True
    return table
