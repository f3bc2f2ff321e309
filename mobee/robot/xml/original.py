# SPDX-License-Identifier: Apache-2.0
"""Rewrites files of the programs of 2010 to 2014 (VirtualSkin, MoBeE) into today's grammar.

The rules are those of the published program (kailfrank/MoBeE, 2014):

- a <motor> whose name was defined before refers to that motor, and its other attributes are ignored;
- a motor without limits has -1 to 1 deg, a joint without limits -180 to 180 deg; a home outside the limits is the nearest limit;
- elements inside a <link> or <joint> are placed relative to its start, a marker at the start itself; a marker without a normal has +x;
- elements inside a <joint> do not turn with it: they belong to the link that carries the joint;
- a radius of 0 or less makes no volume;
- an unknown tag is ignored, but the elements inside it are read;
- a <constraint> outside a <constraintList> is ignored, and so is one that cannot be read;
- pairs of shapes are tested by the rule of pairs_2014.py; shapes near the root of the tree are never tested against the world.

Older generations: in 2012 the attribute `negate` of a <constraint> reversed its inequality to a.q + b < 0, and so it does here; in 2010 a
part was a <branch>, limits were called minPosition and maxPosition, and a <box> had x, y and z.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from mobee.arrays import Array
from mobee.robot.pairs_2014 import near_root
from mobee.robot.writing import degrees, number
from mobee.robot.xml.node import Node, Remark, descendants, shown
from mobee.robot.xml.volume import AXIS, PLACE, Y, align, direction, height_and_angle, link_step, turn_about

PROGRAMS = "the programs of 2010 to 2014"
VOLUMES = ("sphere", "cylinder", "box")
TAGS = frozenset({"zeropositionkinematictree", "bodypart", "constraintlist", "constraint", "motor", "link", "joint", "marker", *VOLUMES})
LIMITS: dict[str, dict[str, str]] = {"motor": {"minPos": "-1", "maxPos": "1"}, "joint": {"minPos": "-180", "maxPos": "180"}}
UNSEEN = {"sphere": (*AXIS, "angle"), "cylinder": ("angle",)}  # rotations that do not change the volume
DRAWN = ("tracer", "detail", "r")  # appearance only
BRANCH_VOLUME = {"vx": "hx", "vy": "hy", "vz": "hz"}
BRANCH_BOX = {"x": "width", "y": "height", "z": "depth"}
GENERATION = "VirtualSkin or MoBeE, 2011 to 2014"


@dataclass(frozen=True, slots=True)
class Evidence:
    """A sign that a file was written for the programs of 2010 to 2014.

    `node`: the element that shows it. `what`: the sign, in words. `generation`: names and years of the programs. `certain`: True if the
    sign cannot occur in a file of the later version 0.1 of the format (`mobee.robot.xml.versions`), because MoBeE 0.1 could not read it.
    """

    node: Node
    what: str
    generation: str = GENERATION
    certain: bool = True

    def remark(self) -> Remark:
        """Return a note for the user: for which programs the file was written (`generation`), and the sign that shows it (`what`)."""
        return Remark(self.node, f"read as a file of {self.generation}, for {self.what}", severity="note")


def find_evidence(root: Node) -> Evidence | None:
    """Return the clearest sign that a robot file was written for the programs of 2010 to 2014; None if there is none.

    A sign that shows the years of the file's format is preferred. The result's attribute `certain` is True if the file has any sign that
    cannot occur in a file of the later version 0.1.
    """
    found = sorted(_evidence(root), key=lambda one: (one.generation == GENERATION, not one.certain))
    return replace(found[0], certain=any(one.certain for one in found)) if found else None


def _evidence(root: Node) -> Iterator[Evidence]:
    motors, markers = set[str](), set[str]()
    lists = any(node.tag == "constraintlist" for node in descendants(root))
    if root.repairs:
        yield Evidence(at_line(root, root.repairs[0].line), root.repairs[0].what)
    for node, parent in _with_parents(root):
        name = node.optional("name")
        if node.tag == "branch":
            yield Evidence(node, "its parts are called <branch>", "the collision avoidance of 2010")
        elif node.tag == "constraint" and parent.tag != "constraintlist":
            generation = GENERATION if lists else "VirtualSkin, April to September 2012"
            yield Evidence(node, "a <constraint> stands outside a <constraintList>", generation)
        elif node.tag == "constraint" and "negate" in node.attributes:
            yield Evidence(node, "a <constraint> is negated", "VirtualSkin or MoBeE, September to November 2012", certain=False)
        elif node.tag == "motor" and name in motors and not {"minPos", "maxPos"} & node.attributes.keys():
            yield Evidence(node, f"the motor {shown(name)!r} is named again")
        elif node.tag == "marker" and name in markers:
            yield Evidence(node, f"two markers are called {shown(name)!r}")
        elif "tracer" in node.attributes or (node.tag == "link" and "noSelfCollision" in node.attributes):
            yield Evidence(node, "tracer or noSelfCollision of a <link>", certain=False)
        if name:
            {"motor": motors, "marker": markers}.get(node.tag, set()).add(name)


def rewrite_original(root: Node) -> list[Remark]:
    """Rewrite the elements of a robot file of 2010 to 2014 into today's grammar, in place; return remarks for the user on the changes."""
    remarks = [Remark(at_line(root, repair.line), repair.what, repair.remedy) for repair in root.repairs]
    old = any(node.tag == "branch" for node in descendants(root))
    remarks += _rewrite_structure(root, old)
    if old:
        _rewrite_volumes_of_2010(root)
    remarks += _rewrite_motors(root)
    remarks += _rewrite_constraints(root)
    remarks += _rewrite_bodies(root)
    root.attributes["adjacency"] = "published_2014"
    _mark_base(root)
    return remarks


def at_line(root: Node, line: int) -> Node:
    """Return an empty node for a line of the file, for remarks on a line without an element."""
    return Node(root.file, line, "", {})


def _with_parents(root: Node) -> Iterator[tuple[Node, Node]]:
    """Yield every element below the root with its parent, in the order of the file."""
    waiting = [(child, root) for child in reversed(root.children)]
    while waiting:
        node, parent = waiting.pop()
        yield node, parent
        waiting += [(child, node) for child in reversed(node.children)]


def _rewrite_structure(root: Node, old: bool) -> list[Remark]:
    """Name parts, rename tags and attributes that had other names, and replace unknown tags by the elements inside them."""
    remarks = []
    waiting, parts = [root], 0
    while waiting:
        node = waiting.pop()
        if node.tag == "branch":
            node.tag = "bodypart"
        if node.tag == "bodypart" and not node.optional("name"):
            parts += 1
            node.attributes["name"] = f"part_{parts}"
            remarks.append(Remark(node, f"the part has no name and is called 'part_{parts}'", "Give it a name", "note"))
        for before, today in (("minPosition", "minPos"), ("maxPosition", "maxPos")):
            if before in node.attributes:
                node.attributes.setdefault(today, node.attributes.pop(before))
        for name in DRAWN:
            node.attributes.pop(name, None)
        if node.tag in ("link", "joint"):
            node.attributes.pop("name", None)  # those programs named neither
        node.children, ignored = _known_children(node, old)
        remarks += ignored
        waiting += reversed(node.children)
    return remarks


def _known_children(node: Node, old: bool) -> tuple[list[Node], list[Remark]]:
    """Return the children of an element, in which unknown tags are replaced by their own children.

    `old`: the file is of 2010, when <branch> was a tag of the format.
    """
    kept, remarks = list[Node](), list[Remark]()
    waiting = list(reversed(node.children))
    while waiting:
        child = waiting.pop()
        if child.tag in TAGS or (child.tag == "branch" and old):
            kept.append(child)
        elif child.tag == "object":
            remarks.append(Remark(child, "an <object> of the world in a robot file is ignored", "Put it into a world file"))
        else:
            remarks.append(Remark(child, f"unknown tag is ignored{', not what stands inside' if child.children else ''}"))
            waiting += reversed(child.children)
    return kept, remarks


def _rewrite_volumes_of_2010(root: Node) -> None:
    """Fill in absent positions, axes and sizes of volumes, which the program of 2010 took from the link or joint around them."""
    for node, parent in list(_with_parents(root)):
        if node.tag not in VOLUMES:
            continue
        for before, today in BRANCH_VOLUME.items() | (BRANCH_BOX.items() if node.tag == "box" else set()):
            if before in node.attributes:
                node.attributes[today] = node.attributes.pop(before)
        step, length = link_step(parent) if parent.tag in ("link", "joint") else (np.zeros(3), 0.0)
        if not node.attributes.keys() & {*PLACE}:
            node.attributes |= vector_texts(PLACE, step / 2)
        if not node.attributes.keys() & {*AXIS} and length > 0:
            node.attributes |= vector_texts(AXIS, step / length)
        if node.tag == "box":
            node.attributes.setdefault("height", number(length))
            axis = direction(node, AXIS, (0.0, 1.0, 0.0))
            shortest = turn_about(axis, np.deg2rad(node.number("angle", 0.0))) @ align(Y, axis)
            axis, angle = height_and_angle(shortest)
            node.attributes = {key: text for key, text in node.attributes.items() if key not in AXIS}
            node.attributes |= vector_texts(AXIS, axis) | {"angle": degrees(angle)}


def _rewrite_motors(root: Node) -> list[Remark]:
    """Fill in limits and homes of motors and joints; for a second <motor> of one name, write the motor's name at the joint."""
    remarks: list[Remark] = []
    known: dict[str, Node] = {}
    waiting: list[tuple[Node, str]] = [(root, "")]
    again: set[int] = set()
    while waiting:
        node, motor = waiting.pop()
        if node.tag == "motor":
            name = node.optional("name")
            if name and name in known:
                remarks += _named_again(node, known[name])
                again.add(id(node))
            else:
                if not name:
                    name = node.attributes["name"] = free_name(f"motor_{len(known)}", known)
                known[name] = node
                remarks += _limits(node)
            motor = name
        elif node.tag == "joint":
            remarks += _limits(node)
            if node.number("minPos") == node.number("maxPos") == 0:
                remarks.append(_fixed(node))
            elif motor:
                node.attributes["motor"] = motor
        waiting += [(child, motor) for child in reversed(node.children)]
    if again:
        _dissolve(root, again)
    return remarks


def _fixed(node: Node) -> Remark:
    """Change a joint whose limits are both 0 into a fixed joint."""
    node.attributes = {name: text for name, text in node.attributes.items() if name not in ("minPos", "maxPos")} | {"type": "fixed"}
    return Remark(node, "the joint cannot move, for its limits are both 0", 'Write type="fixed" in place of the limits', "note")


def _named_again(node: Node, first: Node) -> list[Remark]:
    """Return a remark on the attributes in which a second <motor> of the same name differs from the first; they are ignored.

    The list is empty if there is no difference. Compared are the limits, the home and the index.
    """
    vain = [
        name
        for name in ("minPos", "maxPos", "home", "idx")
        if node.attributes.get(name, first.attributes.get(name)) != first.attributes.get(name)
    ]
    if not vain:
        return []
    name = shown(node.optional("name"))
    what = f"the motor {name!r} is defined in line {first.line}; what is said of it here does not count ({', '.join(vain)})"
    return [Remark(node, what, "Remove it")]


def _limits(node: Node) -> list[Remark]:
    """Fill in absent limits, and move the home of a motor inside its limits."""
    remarks = []
    missing = {name: text for name, text in LIMITS[node.tag].items() if not node.optional(name)}
    if missing:
        node.attributes |= missing
        said = ", ".join(f'{name}="{text}"' for name, text in missing.items())
        remarks.append(Remark(node, f"limits that are left out are those of {PROGRAMS}: {said}", "Write them"))
    if node.tag == "motor" and "home" in node.attributes:
        home, low, high = (node.number(name) for name in ("home", "minPos", "maxPos"))
        if low <= high and not low <= home <= high:
            node.attributes["home"] = number(min(max(home, low), high))
            remarks.append(Remark(node, f"home {home:g} is outside of {low:g} .. {high:g}; the nearest limit counts", "Write another home"))
    return remarks


def _dissolve(root: Node, elements: set[int]) -> None:
    """Replace some elements of the tree below the root by their children; `elements`: the Python ids, id(node), of these elements."""
    for node in list(descendants(root)):
        while any(id(child) in elements for child in node.children):
            node.children = [inner for child in node.children for inner in (child.children if id(child) in elements else [child])]


def _rewrite_constraints(root: Node) -> list[Remark]:
    """Remove each <constraint> and <constraintList> that the published program of 2014 (MoBeE) ignored; return a remark on each."""
    remarks: list[Remark] = []
    waiting: list[tuple[Node, bool]] = [(root, False)]
    while waiting:
        node, in_part = waiting.pop()
        in_part = in_part or node.tag == "bodypart"
        kept = []
        for child in node.children:
            ignored = _ignored_constraint(child, node, in_part) if child.tag in ("constraint", "constraintlist") else None
            if ignored is None:
                kept.append(child)
            else:
                remarks.append(ignored)
        node.children = kept
        waiting += [(child, in_part) for child in reversed(kept)]
    return remarks


def _ignored_constraint(node: Node, parent: Node, in_part: bool) -> Remark | None:
    """Return a remark with the reason why the program of 2014 (MoBeE) ignored a <constraint> or <constraintList>; None if it did not.

    `parent`: the element that contains it. `in_part`: whether it is inside a <bodypart>.
    """
    if node.tag == "constraintlist":
        if not in_part:
            return Remark(node, "<constraintList> outside of every part is ignored, as by the program of 2014", "Move it into a <bodypart>")
        if any(child.tag == "constraint" and _has_row(child) for child in node):
            return None
        return Remark(node, "<constraintList> without a row that can be read is ignored", "Add a <constraint> or remove it")
    if parent.tag != "constraintlist":
        what = "<constraint> outside a <constraintList> is ignored, as by the program of 2014 (VirtualSkin of spring 2012 obeyed it)"
        return Remark(node, what, "Put it into a <constraintList> of its own if it shall count")
    if _has_row(node):
        return None
    what = "<constraint> that cannot be read is ignored, as by the program of 2014"
    return Remark(node, what, "Give a and q equally many numbers, and b one")


def _has_row(node: Node) -> bool:
    """Return whether a <constraint> is a valid row: an inequality a.q + b > 0 of motor positions q.

    It is valid if its attribute `a` lists as many factors as its attribute `q` lists motors, at least one, and its attribute `b` is a
    number.
    """
    a, q = (node.attributes.get(name, "").split(" ") for name in ("a", "q"))
    try:
        float(node.attributes.get("b", ""))
    except ValueError:
        return False
    return 0 < sum(map(bool, a)) == sum(map(bool, q))


def _rewrite_bodies(root: Node) -> list[Remark]:
    """Rewrite the bodies of an old file and return the remarks.

    Changed are radii without effect, missing flags, shapes inside a joint, and markers whose name is absent or already used.
    """
    remarks: list[Remark] = []
    taken: Counter[str] = Counter()
    waiting = [(root, False)]
    while waiting:
        node, in_joint = waiting.pop()
        if node.tag in ("joint", "link"):
            in_joint = node.tag == "joint"
        elif in_joint and node.tag in (*VOLUMES, "marker"):
            node.attributes["turns"] = "false"
        waiting += [(child, in_joint) for child in reversed(node.children)]
        if node.tag in ("link", "joint"):
            for name in ("radius", "field"):
                if name in node.attributes and node.number(name) <= 0:
                    del node.attributes[name]
            if node.attributes.get("noSelfCollision") != "true":
                node.attributes.pop("noSelfCollision", None)
        elif node.tag in VOLUMES:
            if node.attributes.get("field", "").lower() != "true":
                node.attributes.pop("field", None)
            for name in UNSEEN.get(node.tag, ()):
                node.attributes.pop(name, None)
        elif node.tag == "marker":
            remarks += _rewrite_marker(node, taken)
    return remarks


def _rewrite_marker(node: Node, taken: Counter[str]) -> list[Remark]:
    remarks = []
    given = node.optional("name") or f"marker{taken['']}"
    taken[given if node.optional("name") else ""] += 1
    name = given
    if taken[given] > 1:
        name = free_name(f"{given}_{taken[given]}", taken)
        taken[name] += 1
        remarks.append(Remark(node, f"a second marker {shown(given)!r} is called {shown(name)!r}", "Give it a name of its own", "note"))
    node.attributes["name"] = name
    if not node.vector(("nx", "ny", "nz")).any():
        node.attributes = {key: text for key, text in node.attributes.items() if key not in ("nx", "ny", "nz")}
    return remarks


def free_name(name: str, taken: dict[str, Node] | Counter[str]) -> str:
    """Return the name, with as many "_" appended as are necessary to make it different from all names in `taken`."""
    while name in taken:
        name += "_"
    return name


def _mark_base(root: Node) -> None:
    """Write the attribute `base` ("true" or "false") into the <link> and <joint> elements of an old robot file, in place.

    The shapes of an element with base="true" are never tested for contacts with world objects. An element gets this value if it is near
    the root of the tree: on the path from the element up to the root, the tag changes between <link> and <joint> at most twice (exact rule:
    `mobee.robot.pairs_2014.near_root`). MoBeE of 2014 did not test these elements either. The attribute is left out where the reader of
    robot files assumes the right value without it: for a <joint> "false"; for a <link> the value of the nearest <link> or <joint> around
    it, or "true" if there is none. `root`: the root element of the file.
    """
    parents: list[int] = []
    tags: list[str] = []
    elements: list[Node] = []
    waiting = [(root, -1)]
    while waiting:
        node, parent = waiting.pop()
        if node.tag in ("link", "joint"):
            parents.append(parent)
            tags.append(node.tag)
            elements.append(node)
            parent = len(elements) - 1
        waiting += [(child, parent) for child in reversed(node.children)]
    base = [near_root(parents, tags, index) for index in range(len(elements))]
    for index, node in enumerate(elements):
        inherited = tags[index] == "link" and (parents[index] < 0 or base[parents[index]])
        if base[index] != inherited:
            node.attributes["base"] = "true" if base[index] else "false"


def vector_texts(names: tuple[str, str, str], vector: Array) -> dict[str, str]:
    """Return the components of a vector (3,) as XML attributes, name -> text; components that are 0 are left out."""
    return {name: number(float(value)) for name, value in zip(names, vector, strict=True) if value != 0}
