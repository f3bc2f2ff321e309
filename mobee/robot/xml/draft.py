# SPDX-License-Identifier: Apache-2.0
"""The robot read so far from a file, and the reader's position in its tree."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from mobee.arrays import Array
from mobee.robot.join import Placed
from mobee.robot.pairs_2014 import Element
from mobee.robot.robot import Body, Joint, Marker, Shape
from mobee.robot.visual import Camera, Visual
from mobee.robot.xml.motors import MotorDraft
from mobee.robot.xml.node import Node


@dataclass(slots=True)
class Draft:
    """The elements of a robot file that were read so far; indices as in `mobee.robot.robot.Robot`.

    `subtree`: for each link, the index of the element above it that has the attribute noSelfCollision, -1: none; the shapes below such an
    element, usually a hand, are not tested for contacts with each other. `drives`: for each joint, its XML element and the name of its
    motor. `parts`: name -> its XML elements. `hands`: dict from the index of an element with noSelfCollision to its name, for texts that
    state why two links are not tested for contacts. `elements`: the root, and all <link> and <joint> elements. `hosts`: for each shape, the
    index of its element. `shape_names`: name of a shape -> the number that is appended if another shape gets this name. `base_shapes`:
    indices of shapes that are not tested against world objects. `hides`: camera -> its XML element, and the names of the links that it does
    not show. `constraints`: part and XML element of each constraint list. `ignores`: <ignore> elements. `others`: included robots, with the
    XML elements that include them. `where`: (kind, name) -> "file:line".
    """

    links: list[str] = field(default_factory=lambda: ["base"])
    subtree: list[int] = field(default_factory=lambda: [-1])
    joints: list[Joint] = field(default_factory=list)
    drives: list[tuple[Node, str]] = field(default_factory=list)
    motors: dict[str, MotorDraft] = field(default_factory=dict)
    parts: dict[str, list[Node]] = field(default_factory=dict)
    hands: dict[int, str] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=lambda: [Element(-1, "link", "", -1)])
    shapes: list[Shape] = field(default_factory=list)
    hosts: list[int] = field(default_factory=list)
    shape_names: dict[str, int] = field(default_factory=dict)
    base_shapes: set[int] = field(default_factory=set)
    markers: dict[str, Marker] = field(default_factory=dict)
    bodies: list[Body] = field(default_factory=list)  # perhaps several for one link
    visuals: list[Visual] = field(default_factory=list)
    cameras: dict[str, Camera] = field(default_factory=dict)
    hides: dict[str, tuple[Node, tuple[str, ...]]] = field(default_factory=dict)
    constraints: list[tuple[str, Node]] = field(default_factory=list)
    ignores: list[Node] = field(default_factory=list)
    others: list[tuple[Node, Placed]] = field(default_factory=list)
    where: dict[tuple[str, str], str] = field(default_factory=dict)

    def note(self, kind: str, name: str, node: Node) -> None:
        """Record file and line of an element in `where`, unless an element of this kind and name is recorded already."""
        self.where.setdefault((kind, name), f"{node.file}:{node.line}")


@dataclass(frozen=True, slots=True)
class Place:
    """The position of the reader in the tree of a file.

    `point`: (3,) m, root frame, the end of the current <link>, at which the links and joints inside it are attached. `start`: (3,) m, root
    frame, the start of this <link>, to which its shapes and markers are relative. `link`: index of the robot's link. `carrier`: index of
    the link to which elements with turns="false" belong: directly inside a <joint> it is the link that carries the joint, elsewhere it is
    `link`. `part`, `motor`: names of the current part and motor, "": none. `subtree`: index of the outermost element around this
    position that has the attribute noSelfCollision (see `Draft`), -1: none. `base`: whether shapes here belong to `Draft.base_shapes`.
    `element`: index of the current element.
    """

    point: Array
    start: Array
    link: int = 0
    carrier: int = 0
    part: str = ""
    motor: str = ""
    subtree: int = -1
    base: bool = True
    element: int = 0


def enter(node: Node, draft: Draft, place: Place, name: str) -> Place:
    """Add a <link> or <joint> to the elements of the draft and return the position of the reader inside it.

    `place`: position outside it. `name`: name of the element, for texts that state why two links are not tested for contacts.
    """
    index = len(draft.elements)
    if node.flag("noSelfCollision") and place.subtree < 0:
        draft.hands[index] = name
        place = replace(place, subtree=index)
    draft.elements.append(Element(place.element, node.tag, place.part, place.subtree, place.link))
    return replace(place, element=index)
