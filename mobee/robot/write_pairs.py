"""The <ignore> tags that leave a robot its pairs where a file lists all that is not tested."""

from __future__ import annotations

from itertools import combinations
from xml.etree import ElementTree as ET

import numpy as np
from numpy.typing import NDArray

from mobee.robot.robot import Ints, Robot

Table = NDArray[np.bool_]


def ignore_elements(robot: Robot) -> list[ET.Element]:
    """Whole parts where nothing of a role is tested among itself, then pairs of links with their reasons, then pairs of shapes."""
    elements = []
    for pair, reason in robot.untested.items():
        first, second = sorted(pair)
        elements.append(_element(robot.links, first, second, {"reason": reason}))
    for role, pairs in (("solid", robot.solid_pairs), ("field", robot.field_pairs)):
        elements += role_elements(robot, role, pairs, own=True)
    return elements


def role_elements(robot: Robot, role: str, pairs: Ints, own: bool) -> list[ET.Element]:
    """What still has to be left out of one role where the file's rule leaves out `untested`.

    `own`: by that rule fields of one part are tested against each other too.
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
