# SPDX-License-Identifier: Apache-2.0
"""Reads the <visual> elements of a URDF. A faulty element causes only a warning, since the robot moves without it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np

from mobee.errors import RobotFileError, Simplified
from mobee.robot.urdf.frames import Frame, child, read_origin, triple
from mobee.robot.urdf.layout import Skeleton
from mobee.robot.urdf.tree import Tree
from mobee.robot.visual import Channels, MeshSource, Visual, VisualKind
from mobee.robot.xml.node import SMALLEST, Node, descendants

MOST_VISUALS = 2000


def read_visuals(robot: Node, tree: Tree, skeleton: Skeleton) -> tuple[Visual, ...]:
    """Return the visuals of all links of a URDF; an element that cannot be drawn causes a warning (`Simplified`) of one line.

    `robot`: the root element. `skeleton`: the tree at zero pose.
    """
    materials = _materials(robot)
    found: list[Visual] = []
    for link, index in skeleton.index.items():
        for node in tree.links[link]:
            if node.tag != "visual":
                continue
            if len(found) >= MOST_VISUALS:
                node.warn(f"is not drawn, nor are the others after it: a robot has at most {MOST_VISUALS} visuals", Simplified)
                return tuple(found)
            try:
                found += _read(node, index, skeleton.frames[link], materials)
            except RobotFileError as error:
                node.warn(f"is not drawn: {str(error).partition('> ')[2] or error}", Simplified)
    return tuple(found)


def _materials(robot: Node) -> dict[str, Node]:
    """Return the <color> of each material by its name; a material may be defined in the root, or in the first link that uses it."""
    found: dict[str, Node] = {}
    for material in descendants(robot):
        if material.tag == "material" and material.optional("name"):
            for color in material:
                if color.tag == "color":
                    found.setdefault(material.optional("name"), color)
    return found


def _read(node: Node, link: int, frame: Frame, materials: Mapping[str, Node]) -> Iterator[Visual]:
    place = frame @ read_origin(node)
    color = _color(node, materials)
    for form in child(node, "geometry") or ():
        kind: VisualKind
        size: tuple[float, ...]
        mesh: MeshSource | None = None
        match form.tag:
            case "sphere":
                kind, size = "sphere", (form.positive("radius"),)
            case "cylinder":
                kind, size = "cylinder", (form.positive("radius"), form.positive("length"))
            case "capsule":
                kind, size = "capsule", (form.positive("radius"), form.positive("length"))
            case "box":
                x, y, z = np.maximum(np.abs(triple(form, "size")), SMALLEST).tolist()
                kind, size = "box", (x, y, z)
            case "mesh":
                x, y, z = (triple(form, "scale") if "scale" in form.attributes else np.ones(3)).tolist()
                kind, size = "mesh", ()
                mesh = MeshSource(form.text("filename"), Path(form.file), form.line, scale=(x, y, z))
            case _:
                continue
        yield Visual(link, kind, size, place.position, place.rotation, color, mesh)


def _color(node: Node, materials: Mapping[str, Node]) -> Channels | None:
    """Return the colour of the <material>, by itself or by its name; None if it has none."""
    material = child(node, "material")
    if material is None:
        return None
    given = child(material, "color") or materials.get(material.optional("name"))
    if given is None or "rgba" not in given.attributes:
        return None
    red, green, blue, opacity = np.clip(given.numbers("rgba", 4), 0.0, 1.0).tolist()
    return red, green, blue, opacity
