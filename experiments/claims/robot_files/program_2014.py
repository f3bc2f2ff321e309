# SPDX-License-Identifier: Apache-2.0
"""The rules by which the MoBeE program of 2014 read robot files, written again from its source; no code is shared with mobee.robot.

The module reads files of 2011 to 2014 with the standard library's XML parser, and makes every <link> and <joint> a node of a tree, as the
program did (kailfrank/MoBeE: zphandler, kintreenode, transformable, linearconstraint).  Positions are in m; positions of motors and
limits of joints are in degrees, as in a file.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(eq=False)
class Volume:
    """A collision volume on a node of the tree.

    `kind`: "sphere", "cylinder" or "box".  `size` [m]: (radius,) of a sphere, (radius, height) of a cylinder, or the three edges of a box.
    `position` (3,) m and `rotation` (3, 3): pose relative to the start of the node.
    """

    kind: str
    size: tuple[float, ...]
    position: Array
    rotation: Array


@dataclass(eq=False)
class Node:
    """A <link> or <joint> of a file, as a node of the tree.

    `part`: name of its body part, "" outside of one.  `axis`: vector from start to end of a link [m], or rotation axis of a joint, (3,).
    `limits`: of a joint [deg]; not used for a link.  `motor`: name of the motor of a joint.  `solids`: its solid volumes.  `fields`: its
    volumes that are not solid.  `hand`: the node with noSelfCollision="true" in whose subtree this one is, which may be the node itself;
    None without such a node.
    """

    is_link: bool
    parent: Node | None
    part: str
    axis: Array
    motor: str = ""
    limits: tuple[float, float] = (0.0, 0.0)
    solids: list[Volume] = field(default_factory=list)
    fields: list[Volume] = field(default_factory=list)
    children: list[Node] = field(default_factory=list)
    hand: Node | None = None


@dataclass
class Program:
    """The contents of a robot file as the MoBeE program of 2014 (kailfrank/MoBeE) read them.

    `nodes`: parents before children.  `motors`: dict from a name to lower limit, upper limit and home [deg].  `markers`: name, node and
    normal (3,) of each.  `clauses`: constraints on several joints, each a list of rows, of which at least one must hold; a row has the
    names of motors, their factors and an offset.
    """

    nodes: list[Node] = field(default_factory=list)
    motors: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    markers: list[tuple[str, Node, Array]] = field(default_factory=list)
    clauses: list[list[tuple[list[str], list[float], float]]] = field(default_factory=list)

    @classmethod
    def read(cls, path: Path) -> Program:
        """Read a robot file by the rules of the MoBeE program of 2014."""
        program, root = cls(), ET.fromstring(_first_attributes(path.read_text(encoding="utf-8", errors="replace")))
        program._walk(root, None, "", "", None)
        program._read_clauses(root)
        return program

    def _walk(self, element: ET.Element, node: Node | None, part: str, motor: str, hand: Node | None) -> None:
        for child in element:
            tag = child.tag.lower()
            numbers = {name: float(text) for name, text in child.attrib.items() if _is_number(text)}
            if tag == "bodypart":
                self._walk(child, node, child.get("name", ""), motor, hand)
            elif tag == "motor":
                name = child.get("name") or f"motor_{len(self.motors)}"
                if name not in self.motors:
                    low, high = numbers.get("minPos", -1.0), numbers.get("maxPos", 1.0)
                    self.motors[name] = (low, high, min(max(numbers.get("home", 0.0), low), high))
                self._walk(child, node, part, name, hand)
            elif tag in ("link", "joint"):
                vector = np.array([numbers.get(axis, 0.0) for axis in "xyz"])
                length = numbers.get("length", 0.0) or float(np.linalg.norm(vector))
                axis = vector / np.linalg.norm(vector) * length
                inner = Node(tag == "link", node, part, axis, "" if tag == "link" else motor)
                inner.limits = (numbers.get("minPos", -180.0), numbers.get("maxPos", 180.0))
                inner.hand = hand or (inner if child.get("noSelfCollision") == "true" else None)
                for name, volumes in (("radius", inner.solids), ("field", inner.fields)):
                    if numbers.get(name, 0.0) > 0:
                        place = axis / 2 if inner.is_link else np.zeros(3)
                        volumes.append(Volume("cylinder", (numbers[name], length), place, special_euler(axis, 0.0)))
                self.nodes.append(inner)
                if node:
                    node.children.append(inner)
                self._walk(child, inner, part, motor, inner.hand)
            elif tag in ("sphere", "cylinder", "box") and node:
                names = {"sphere": ("radius",), "cylinder": ("radius", "height"), "box": ("width", "height", "depth")}[tag]
                height = np.array([numbers.get(axis, 0.0) for axis in ("hx", "hy", "hz")])
                turn = special_euler(height if height.any() else np.array([0.0, 1.0, 0.0]), math.radians(numbers.get("angle", 0.0)))
                place = np.array([numbers.get(axis, 0.0) for axis in ("px", "py", "pz")])
                volume = Volume(tag, tuple(numbers[name] for name in names), place, turn)
                (node.fields if child.get("field", "").lower() == "true" else node.solids).append(volume)
            elif tag == "marker" and node:
                normal = np.array([numbers.get(axis, 0.0) for axis in ("nx", "ny", "nz")])
                normal = normal / np.linalg.norm(normal) if normal.any() else np.array([1.0, 0.0, 0.0])
                self.markers.append((child.get("name", ""), node, normal))
            elif tag not in ("constraint", "constraintlist"):
                self._walk(child, node, part, motor, hand)

    def _read_clauses(self, root: ET.Element) -> None:
        """Read the clauses (constraints on several joints) into `clauses`.

        A clause names motors by numbers within its body part: the attribute idx of the motor, or without it the place in the file.  As in
        2012, the attribute `negate` reverses the inequality of a row; the program of 2014 ignored it.
        """
        order: dict[str, dict[int, str]] = {}
        seen = set[str]()
        found: list[tuple[str, ET.Element]] = []

        def walk(element: ET.Element, part: str) -> None:
            for child in element:
                tag = child.tag.lower()
                if tag == "motor" and child.get("name") not in seen:
                    name = child.get("name") or f"motor_{len(seen)}"
                    seen.add(name)
                    mine = order.setdefault(part, {})
                    mine[int(child.get("idx") or max(mine, default=-1) + 1)] = name
                if tag == "constraintlist":
                    found.append((part, child))
                walk(child, child.get("name", "") if tag == "bodypart" else part)

        walk(root, "")
        for part, element in found:
            rows = []
            for row in element:
                motors = [order[part][int(word)] for word in row.get("q", "").split()]
                sign = -1.0 if row.get("negate") == "true" else 1.0
                factors = [sign * float(word) for word in row.get("a", "").split()]
                rows.append((motors, factors, sign * float(row.get("b", ""))))
            self.clauses.append(rows)

    def poses(self, q: dict[str, float]) -> dict[Node, Array]:
        """Return a dict from every node to the transform (4, 4) from its start to the root frame, translations in m.

        `q`: a dict from the name of a motor to its position [deg].
        """
        placed: dict[Node, Array] = {}
        for node in self.nodes:  # parents come before their children
            carrier = node.parent
            placed[node] = np.eye(4) if carrier is None else placed[carrier] @ self._step(carrier, q)
        return placed

    def _step(self, node: Node, q: dict[str, float]) -> Array:
        step = np.eye(4)
        if node.is_link:
            step[:3, 3] = node.axis
            return step
        low, high, _ = self.motors[node.motor]
        first, last = node.limits
        angle = math.radians(first + (q[node.motor] - low) / (high - low) * (last - first))
        step[:3, :3] = axis_angle(node.axis, angle)
        return step

    def ignored(self) -> tuple[set[frozenset[Node]], set[frozenset[Node]]]:
        """Return the pairs of nodes whose solid volumes, and those whose other volumes (fields), are never tested against each other."""
        solids, fields = set[frozenset[Node]](), set[frozenset[Node]]()
        roots = [node for node in self.nodes if node.parent is None]

        def descend(this: Node, node: Node, found_link: bool, found_joint: bool) -> None:
            if this.parent is not None and this.parent is not node.parent:
                if found_link and found_joint and this.is_link != node.is_link:
                    return
                if this.is_link and not this.parent.is_link and this.solids:
                    found_link = True
                elif not this.is_link and this.parent.is_link and this.solids:
                    found_joint = True
            if this.part == node.part or node is this.parent or node.parent is this.parent:
                solids.add(frozenset((this, node)))
            fields.add(frozenset((this, node)))
            for child in this.children:
                descend(child, node, found_link, found_joint)

        for this in self.nodes:
            for node in this.parent.children if this.parent else roots:
                descend(this, node, False, False)
        for first, second in combinations(self.nodes, 2):
            if first.hand is not None and first.hand is second.hand:
                solids.add(frozenset((first, second)))
                fields.add(frozenset((first, second)))
        return solids, fields

    def is_base(self, node: Node) -> bool:
        """Whether the volumes of a node are never tested against the world."""
        this, found_link, found_joint = node, False, False
        while this.parent is not None:
            if found_link and found_joint and this.is_link != node.is_link:
                return False
            if this.is_link and not this.parent.is_link:
                found_link = True
            elif not this.is_link and this.parent.is_link:
                found_joint = True
            this = this.parent
        return True

    def obeys(self, clause: list[tuple[list[str], list[float], float]], q: dict[str, float]) -> bool:
        """Whether at least one row of a clause holds, that is, the sum of factors times positions plus offset is above 0.

        `q`: a dict from the name of a motor to its position [deg].
        """
        return any(sum(a * q[name] for name, a in zip(names, factors, strict=True)) + b > 0 for names, factors, b in clause)


def special_euler(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) that gives a volume its height axis, as MoBeE of 2014 computed it.

    The first rotation is about y, by the angle (0 to 180 degrees) between x and the projection of `axis` (3,) on the x-z plane; then the
    shortest rotation brings y to `axis`; the last rotation, by `angle` [rad], is about `axis`.
    """
    turn = np.eye(3)
    flat = np.array([axis[0], 0.0, axis[2]])
    if np.linalg.norm(flat) > 1e-6:
        turn = axis_angle(np.array([0.0, 1.0, 0.0]), math.acos(flat[0] / np.linalg.norm(flat)))
    normal = np.cross([0.0, 1.0, 0.0], axis)
    turn = axis_angle(normal, math.acos(max(-1.0, min(1.0, axis[1] / np.linalg.norm(axis))))) @ turn
    return axis_angle(axis, angle) @ turn


def axis_angle(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by `angle` [rad] about `axis` (3,), which may have any length.

    For length 0 it is cos(angle) times the identity, as in MoBeE of 2014.
    """
    length = np.linalg.norm(axis)
    x, y, z = axis / length if length > 1e-6 else (0.0, 0.0, 0.0)
    c, s, v = math.cos(angle), math.sin(angle), 1 - math.cos(angle)
    return np.array(
        [
            [x * x * v + c, x * y * v - z * s, x * z * v + y * s],
            [x * y * v + z * s, y * y * v + c, y * z * v - x * s],
            [x * z * v - y * s, y * z * v + x * s, z * z * v + c],
        ]
    )


def _first_attributes(text: str) -> str:
    """Return the XML text without repeated attributes: of attributes with one name in a tag only the first is kept, as by the program."""

    def first(tag: re.Match[str]) -> str:
        kept: dict[str, str] = {}
        for attribute in re.findall(r"""\s+[\w:]+\s*=\s*(?:"[^"]*"|'[^']*')""", tag[2]):
            kept.setdefault(attribute.split("=")[0].strip(), attribute)
        return f"<{tag[1]}{''.join(kept.values())}{tag[3]}>"

    return re.sub(r"""<(\w+)((?:\s+[\w:]+\s*=\s*(?:"[^"]*"|'[^']*'))*)\s*(/?)>""", first, text)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
