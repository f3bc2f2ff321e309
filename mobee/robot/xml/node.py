# SPDX-License-Identifier: Apache-2.0
"""XML as plain nodes with line numbers and typed attributes; reads and writes files."""

from __future__ import annotations

import difflib
import math
import warnings
import xml.sax.xmlreader
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, NoReturn
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import numpy as np

from mobee.arrays import Array
from mobee.errors import RobotFileError
from mobee.robot.writing import write_whole
from mobee.robot.xml.file import LARGEST, MOST_REPAIRS, LineHandler, Repair, mend, parse_content, read_content

DEEPEST = 2000  # elements inside each other: 500 joints, each in a motor and a link
MOST_ELEMENTS = 50_000
FARTHEST = 1e18  # beyond it the readers' arithmetic would overflow; some files write 1e16 for "no limit"
SMALLEST = 1e-9
LISTED = 40  # names in one message
FLAGS = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}


@dataclass(slots=True, eq=False)
class Node:
    """An XML element: tag in lower case, attributes as text, children, file and line.

    `repairs`: for a root element, the repaired faults of the file's XML syntax or encoding; empty for other elements.
    """

    file: Path
    line: int
    tag: str
    attributes: dict[str, str]
    children: list[Node] = field(default_factory=list)
    repairs: list[Repair] = field(default_factory=list)

    def __iter__(self) -> Iterator[Node]:
        return iter(self.children)

    def fail(self, what: str, problem: str, remedy: str) -> NoReturn:
        """Raise RobotFileError for this element, with file and line.

        `what`: the faulty attribute or field. `problem`: what is wrong with it. `remedy`: what the user can do.
        """
        raise RobotFileError(f"{self.file}:{self.line}: <{shown(self.tag)}> {what}: {problem}. {remedy}")

    def number(self, name: str, default: float | None = None) -> float:
        """Return the number in the attribute `name`, in the unit of the file; `default` if it is absent.

        Raises RobotFileError if it is not a number from -1e18 to 1e18, or if it is absent without a default.
        """
        if name not in self.attributes:
            if default is None:
                self.missing(name)
            return default
        return self.finite(name, self.attributes[name])

    def finite(self, name: str, text: str) -> float:
        """Convert a text of the attribute `name` to a number; raises RobotFileError unless it is one from -1e18 to 1e18."""
        try:
            value = float(text)
        except ValueError:
            value = None
        if value is None or "_" in text or not text.isascii():  # both are numbers to Python only
            remedy = "Run xacro first, which puts values in its place" if "$" in text else "Write a decimal number such as -0.25"
            self.fail(name, f"{shown(text)!r} is not a number", remedy)
        if not abs(value) <= FARTHEST:
            problem = "is too large" if math.isfinite(value) else "is not finite"
            self.fail(name, f"{shown(text)!r} {problem}", "Write a decimal number such as -0.25")
        return value

    def positive(self, name: str, default: float | None = None, unit: str = "metres") -> float:
        """Return the number in the attribute `name`; `default` if it is absent. Raises RobotFileError if it is below 1e-9.

        `unit`: unit of the number, for the message.
        """
        value = self.number(name, default)
        if value < SMALLEST:
            self.fail(name, f"{value:g} is {'not positive' if value <= 0 else 'too small'}", f"Write a value above 0, in {unit}")
        return value

    def vector(self, names: tuple[str, str, str], default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        """Return numbers (3,) from the three attributes `names`; `default` if all three are absent, 0 for a single one that is absent."""
        if not any(name in self.attributes for name in names):
            return np.array(default)
        return np.array([self.number(name, 0.0) for name in names])

    def numbers(self, name: str, count: int | None = None) -> list[float]:
        """Return the numbers in the attribute `name`, which are separated by blanks or commas; the attribute is required.

        Raises RobotFileError if there are not `count` numbers; None: any number of them.
        """
        values = [self.finite(name, word) for word in self.words(name)]
        if count is not None and len(values) != count:
            self.fail(name, f"has {len(values)} numbers", f"Write {count} numbers separated by blanks")
        return values

    def words(self, name: str) -> list[str]:
        """Return the words in the attribute `name`, which are separated by blanks or commas; raises RobotFileError if it is absent."""
        if name not in self.attributes:
            self.missing(name)
        return self.attributes[name].replace(",", " ").split()

    def text(self, name: str) -> str:
        """Return the text of the attribute `name`; raises RobotFileError if it is absent or empty."""
        return self.optional(name) or self.missing(name)

    def optional(self, name: str) -> str:
        """Return the text of the attribute `name`; "" if it is absent."""
        return self.attributes.get(name, "").strip()

    def flag(self, name: str, default: bool = False) -> bool:
        """Return the boolean in the attribute `name`; `default` if it is absent.

        Valid texts are true, yes, 1, false, no and 0; others raise RobotFileError.
        """
        if name not in self.attributes:
            return default
        value = self.attributes[name].strip().lower()
        if value not in FLAGS:
            self.fail(name, f"{shown(self.attributes[name])!r} is neither true nor false", "Write true or false")
        return FLAGS[value]

    def choice(self, name: str, given: str, valid: Collection[str], kind: str) -> str:
        """Return the text `given` if it is one of the `valid` ones; else raise RobotFileError with the nearest valid one.

        `name`: name of the attribute. `kind`: the kind of thing that the text names, such as "motor". Both are for the message.
        """
        if given not in valid:
            self.fail(name, f"unknown {kind} {shown(given)!r}", f"{nearest(given, valid)}Valid: {listed(valid)}")
        return given

    def missing(self, name: str) -> NoReturn:
        """Raise RobotFileError because the required attribute `name` is absent; the message names a similar attribute, if there is one."""
        given = sorted(self.attributes)
        near = difflib.get_close_matches(name, given, n=1, cutoff=0.5) if len(given) <= LISTED else []
        remedy = f"Did you misspell it as {near[0]!r}? " if near else ""
        self.fail(name, "is required and missing", f'{remedy}Add {name}="..." (given: {listed(given) if given else "nothing"})')

    def check_attributes(self, known: Collection[str]) -> None:
        """Warn of each attribute of this element that is not one of the `known` names."""
        for name in self.attributes:
            if name not in known:
                self.warn(f"unknown attribute {shown(name)!r} is ignored. {nearest(name, known)}Valid: {listed(known)}")

    def warn(self, problem: str, category: type[Warning] = UserWarning) -> None:
        """Issue a warning about this element: the text `problem` with file, line and tag."""
        tag = f"<{shown(self.tag)}>: " if self.tag else ""
        warnings.warn(f"{self.file}:{self.line}: {tag}{problem}", category, stacklevel=2)


@dataclass(frozen=True, slots=True)
class Remark:
    """A note or warning on how an element was interpreted.

    `what`: the interpretation. `remedy`: for the user. `severity`: `mobee.robot.xml.versions.report` issues a warning for a "warning", and
    none for a "note".
    """

    node: Node
    what: str
    remedy: str = ""
    severity: Literal["warning", "note"] = "warning"


def nearest(given: str, valid: Collection[str]) -> str:
    """Return the text "Did you mean ...? " with the valid name that is most similar to `given`; "" if none is similar."""
    lower = {name.lower(): name for name in valid}
    near = difflib.get_close_matches(given.lower(), lower, n=1) if len(given) <= 100 else []
    return f"Did you mean {lower[near[0]]!r}? " if near else ""


def listed(names: Collection[str]) -> str:
    """Return names as text for a message, sorted; if there are more than LISTED (40), only the first 40."""
    words = [shown(name) for name in sorted(names)]
    rest = f" and {len(words) - LISTED} more" if len(words) > LISTED else ""
    return (", ".join(words[:LISTED]) or "none") + rest


def shown(text: str) -> str:
    """Return a text for a message, shortened to 60 characters if it is longer."""
    return text if len(text) <= 60 else f"{text[:57]}..."


def descendants(root: Node) -> Iterator[Node]:
    """Yield a node and all nodes inside it, in the order of the file."""
    waiting = [root]
    while waiting:
        node = waiting.pop()
        yield node
        waiting += reversed(node.children)


def read_xml(path: Path, *, repair: bool = False) -> Node:
    """Return the root element of an XML file, with all elements inside it.

    `repair`: True: repair attributes that are given twice and bytes that are not UTF-8, and list the repairs in the root's `repairs`.
    Raises RobotFileError if the file is missing or not XML; if it has entities or external references (they can exhaust memory or read
    other files); or if it is too large: above 8 MB, 50 000 elements or 2000 elements inside each other.
    """
    content, repairs = read_content(path), list[Repair]()
    while True:
        builder = _Builder(path)
        try:
            parse_content(path, content, builder)
            break
        except RobotFileError as error:
            mended = mend(content, error) if repair and len(repairs) < MOST_REPAIRS else None
            if mended is None:
                raise
            content = mended.content
            repairs.append(mended.repair)
    if builder.root is None:
        raise RobotFileError(f"{path}:1: holds no element. Write a root element.")
    builder.root.repairs = repairs
    return builder.root


class _Builder(LineHandler):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.root: Node | None = None
        self.open: list[Node] = []
        self.elements = 0
        self.length = 0  # of all attributes: a DTD can give a long default value to every element

    def startElement(self, name: str, attrs: xml.sax.xmlreader.AttributesImpl) -> None:
        node = Node(self.path, self.line, name.lower(), dict(attrs.items()))
        self.elements += 1
        self.length += sum(map(len, node.attributes.values()))
        if len(self.open) >= DEEPEST:
            node.fail("position in the file", f"is nested more than {DEEPEST} elements deep", "Close the elements before it")
        if self.elements > MOST_ELEMENTS or self.length > LARGEST:
            node.fail("size of the file", f"more than {MOST_ELEMENTS} elements or {LARGEST} characters", "Divide the file")
        if self.open:
            self.open[-1].children.append(node)
        else:
            self.root = node
        self.open.append(node)

    def endElement(self, name: str) -> None:
        self.open.pop()


VERSION = "2.0"  # of the grammar of robots and worlds that this library writes
SPELLING = {"zeropositionkinematictree": "ZeroPositionKinematicTree", "constraintlist": "constraintList", "world": "World"}


def tree_of(node: Node) -> ET.Element:
    """Return a node that was read, with all elements inside it, as an ElementTree element.

    A Node has its tag in lower case; the result has the tags as in robot and world files, such as ZeroPositionKinematicTree.
    """
    root = ET.Element(SPELLING.get(node.tag, node.tag), node.attributes)
    waiting = [(node, root)]
    while waiting:
        source, target = waiting.pop()
        waiting += [(child, ET.SubElement(target, SPELLING.get(child.tag, child.tag), child.attributes)) for child in source]
    return root


def write_tree(root: ET.Element, path: Path, heading: str = "") -> Path:
    """Write an XML file, one element per line, and return its path; `heading`: text of a comment above the root element.

    The standard library's writer is recursive and fails beyond some hundred levels; a chain of 500 joints has more.
    An existing file is replaced only after all is written, so that an error leaves it unchanged. Raises OSError.
    """
    lines = ['<?xml version="1.0" encoding="utf-8"?>'] + ([f"<!--\n{heading.strip().replace('--', '- -')}\n-->"] if heading else [])
    waiting: list[tuple[ET.Element | str, int]] = [(root, 0)]
    while waiting:
        element, depth = waiting.pop()
        indent = " " * depth
        if isinstance(element, str):
            lines.append(f"{indent}</{element}>")
            continue
        attributes = "".join(f" {name}={quoteattr(value)}" for name, value in element.items())
        if not len(element):
            lines.append(f"{indent}<{element.tag}{attributes}/>")
            continue
        lines.append(f"{indent}<{element.tag}{attributes}>")
        waiting.append((element.tag, depth))
        waiting += [(child, depth + 1) for child in reversed(element)]
    return write_whole(path, ("\n".join(lines) + "\n").encode())
