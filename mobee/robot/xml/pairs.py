# SPDX-License-Identifier: Apache-2.0
"""Reads and writes <ignore> tags of a robot file: pairs of links or shapes that are not tested for contacts."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from itertools import combinations
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from mobee.arrays import Ints
from mobee.robot.pairs import link_pairs, merged
from mobee.robot.robot import LinkPair, Robot
from mobee.robot.xml.node import Node

ROLES = ("solid", "field", "both")
IGNORE_ATTRIBUTES = frozenset({"first", "second", "of", "part", "role", "reason"})


@dataclass(slots=True)
class _Ignored:
    """The content of the <ignore> elements of one role: what is not tested for contacts among solids, among fields, or both.

    `links`: pairs of links, each with the reason. `shapes`: pairs of indices of shapes. `parts`: names of parts whose shapes are not tested
    with each other.
    """

    links: dict[LinkPair, str] = field(default_factory=dict)  # and why
    shapes: set[frozenset[int]] = field(default_factory=set)
    parts: set[str] = field(default_factory=set)


def without_ignored(robot: Robot, nodes: Iterable[Node]) -> Robot:
    """Return a copy of the robot in which the pairs named in <ignore> elements are not tested for contacts.

    `nodes`: the <ignore> elements. Raises RobotFileError for an unknown link, shape, part or role.
    """
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


Table = NDArray[np.bool_]


def ignore_elements(robot: Robot) -> list[ET.Element]:
    """Return the <ignore> elements that describe which pairs of shapes of the robot are not tested for contacts.

    First come the pairs of links that are never tested, with reasons. Then follow, for solids and for fields: parts whose shapes are not
    tested with each other, pairs of links, and single pairs of shapes.
    """
    elements = []
    for pair, reason in robot.untested.items():
        first, second = sorted(pair)
        elements.append(_element(robot.links, first, second, {"reason": reason}))
    for role, pairs in (("solid", robot.solid_pairs), ("field", robot.field_pairs)):
        elements += role_elements(robot, role, pairs, own=True)
    return elements


def role_elements(robot: Robot, role: str, pairs: Ints, own: bool) -> list[ET.Element]:
    """Return the <ignore> elements for the pairs of shapes of one role that are not tested for contacts.

    The pairs of links in `robot.untested` are left out. `role`: "solid", or "field", a volume that causes a repulsive force. `pairs`:
    (p, 2) indices of shapes, the pairs that are tested. `own`: True: the reader of the file tests fields of one part with each other,
    unless an <ignore> element excludes them. False: it never tests them, so that they need no <ignore> elements.
    """
    chosen = np.array([k for k, shape in enumerate(robot.shapes) if shape.role == role], dtype=np.intp)
    link = np.array([robot.shapes[k].link for k in chosen], dtype=np.intp)
    wanted = np.zeros((len(robot.shapes),) * 2, dtype=bool)
    for a, b in pairs.tolist():
        wanted[a, b] = wanted[b, a] = True
    wanted = wanted[np.ix_(chosen, chosen)]
    free = np.ones((len(robot.links),) * 2, dtype=bool)
    for a, b in map(tuple, robot.untested):
        free[a, b] = free[b, a] = False
    extra = free[link[:, None], link] & (link[:, None] != link) & ~wanted  # tested by the file so far, but not by the robot
    if role == "field" and not own:
        part = np.array([robot.shapes[k].part for k in chosen])
        extra &= part[:, None] != part
    elements = _parts(robot, role, chosen, wanted, extra)
    for a, b in combinations(range(len(robot.links)), 2):
        block = np.ix_(link == a, link == b)
        if extra[block].any() and not wanted[block].any():
            elements.append(_element(robot.links, a, b, {"role": role}))
            extra[block] = False
            extra[np.ix_(link == b, link == a)] = False
    names = tuple(robot.shapes[k].name for k in chosen)
    return elements + [_element(names, a, b, {"of": "shapes"}) for a, b in np.argwhere(np.triu(extra)).tolist()]


def _parts(robot: Robot, role: str, chosen: Ints, wanted: Table, extra: Table) -> list[ET.Element]:
    part = np.array([robot.shapes[k].part for k in chosen])
    elements = []
    for name in robot.parts:
        block = np.ix_(part == name, part == name)
        if extra[block].any() and not wanted[block].any():
            elements.append(ET.Element("ignore", part=name, role=role))
            extra[block] = False
    return elements


def _element(names: tuple[str, ...], first: int, second: int, attributes: dict[str, str]) -> ET.Element:
    return ET.Element("ignore", {"first": names[first], "second": names[second]} | attributes)
