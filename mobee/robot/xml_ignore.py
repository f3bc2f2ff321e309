"""The tag ignore: pairs of links that the file itself leaves out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from mobee.robot.pairs import link_pairs, merged
from mobee.robot.robot import Ints, LinkPair, Robot
from mobee.robot.xml_node import Node

ROLES = ("solid", "field", "both")


def without_ignored(robot: Robot, nodes: Iterable[Node]) -> Robot:
    """The robot without the pairs that <ignore> tags name; raises RobotFileError for an unknown link or role."""
    lines: dict[str, dict[LinkPair, str]] = {role: {} for role in ROLES}
    for node in nodes:
        role = node.choice("role", node.attributes.get("role", "both"), ROLES, "role")
        first, second = (robot.links.index(node.choice(end, node.text(end), robot.links, "link")) for end in ("first", "second"))
        if first == second:
            node.fail("second", "is the first link again", "Name two links; shapes of one link are never tested against each other")
        lines[role].setdefault(frozenset((first, second)), f"the file says so, line {node.line}")
    if not any(lines.values()):
        return robot
    solid_pairs = _kept(robot, robot.solid_pairs, lines["solid"].keys() | lines["both"].keys())
    field_pairs = _kept(robot, robot.field_pairs, lines["field"].keys() | lines["both"].keys())
    tested = link_pairs(robot.shapes, field_pairs)
    solids = {pair: reason for pair, reason in lines["solid"].items() if pair not in tested}
    return replace(robot, solid_pairs=solid_pairs, field_pairs=field_pairs, untested=merged(robot.untested, lines["both"], solids))


def _kept(robot: Robot, pairs: Ints, ignored: Iterable[LinkPair]) -> Ints:
    table = np.zeros((len(robot.links), len(robot.links)), dtype=bool)
    for pair in ignored:
        a, b = pair
        table[a, b] = table[b, a] = True
    link = np.array([shape.link for shape in robot.shapes], dtype=np.intp)
    ends = link[pairs].reshape(-1, 2)
    return pairs[~table[ends[:, 0], ends[:, 1]]]
