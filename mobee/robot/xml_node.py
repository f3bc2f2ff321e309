"""An XML file as plain nodes that remember their line, with typed access to attributes."""

from __future__ import annotations

import difflib
import math
import warnings
import xml.sax
import xml.sax.handler
import xml.sax.xmlreader
from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import defusedxml
import defusedxml.sax
import numpy as np

from mobee.errors import RobotFileError
from mobee.robot.robot import Array

DEEPEST = 200  # elements; a reader that recurses must not be led into its own limit
FLAGS = {"true": True, "1": True, "yes": True, "false": False, "0": False, "no": False}


@dataclass(slots=True, eq=False)
class Node:
    """One element: its tag in lower case, its attributes, its children, and where it stands."""

    file: Path
    line: int
    tag: str
    attributes: dict[str, str]
    children: list[Node] = field(default_factory=list)

    def __iter__(self) -> Iterator[Node]:
        return iter(self.children)

    def fail(self, what: str, problem: str, remedy: str) -> NoReturn:
        """Raise RobotFileError with file, line, field, problem and remedy."""
        raise RobotFileError(f"{self.file}:{self.line}: <{self.tag}> {what}: {problem}. {remedy}")

    def number(self, name: str, default: float | None = None) -> float:
        """A finite number, in the unit of the file; without a default the attribute is required."""
        if name not in self.attributes:
            if default is None:
                self.missing(name)
            return default
        return self.finite(name, self.attributes[name])

    def finite(self, name: str, text: str) -> float:
        """A finite number from the text of attribute `name`."""
        try:
            value = float(text)
        except ValueError:
            self.fail(name, f"{text!r} is not a number", "Write a decimal number such as -0.25")
        if not math.isfinite(value):
            self.fail(name, f"{text!r} is not finite", "Write a decimal number such as -0.25")
        return value

    def positive(self, name: str, default: float | None = None) -> float:
        """A number above zero."""
        value = self.number(name, default)
        if value <= 0:
            self.fail(name, f"{value:g} is not positive", "Write a size above 0, in metres")
        return value

    def vector(self, names: tuple[str, str, str], default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Array:
        """Three numbers from three attributes; `default` where none of them is given, zero for single missing ones."""
        if not any(name in self.attributes for name in names):
            return np.array(default)
        return np.array([self.number(name, 0.0) for name in names])

    def numbers(self, name: str, count: int | None = None) -> list[float]:
        """A list of numbers separated by blanks or commas, of the given length."""
        values = [self.finite(name, word) for word in self.words(name)]
        if count is not None and len(values) != count:
            self.fail(name, f"has {len(values)} numbers", f"Write {count} numbers separated by blanks")
        return values

    def words(self, name: str) -> list[str]:
        """A required list of words separated by blanks or commas."""
        if name not in self.attributes:
            self.missing(name)
        return self.attributes[name].replace(",", " ").split()

    def text(self, name: str) -> str:
        """A required, non-empty text."""
        if not self.attributes.get(name, "").strip():
            self.missing(name)
        return self.attributes[name].strip()

    def flag(self, name: str, default: bool = False) -> bool:
        """A yes or no."""
        if name not in self.attributes:
            return default
        value = self.attributes[name].strip().lower()
        if value not in FLAGS:
            self.fail(name, f"{self.attributes[name]!r} is neither true nor false", "Write true or false")
        return FLAGS[value]

    def choice(self, name: str, given: str, valid: Collection[str], kind: str) -> str:
        """The given name if it is one of the valid ones; else an error with the nearest."""
        if given not in valid:
            self.fail(name, f"unknown {kind} {given!r}", f"{nearest(given, valid)}Valid: {', '.join(sorted(valid)) or 'none'}")
        return given

    def missing(self, name: str) -> NoReturn:
        """Raise the error of a required attribute that is not there, naming a misspelt one if it looks like it."""
        given = sorted(self.attributes)
        near = difflib.get_close_matches(name, given, n=1, cutoff=0.5)
        remedy = f"Did you misspell it as {near[0]!r}? " if near else ""
        self.fail(name, "is required and missing", f'{remedy}Add {name}="..." (given: {", ".join(given) or "nothing"})')

    def check_attributes(self, known: Collection[str]) -> None:
        """Warn of attributes that the grammar does not know."""
        for name in self.attributes:
            if name not in known:
                self.warn(f"unknown attribute {name!r} is ignored. {nearest(name, known)}Valid: {', '.join(sorted(known))}")

    def warn(self, problem: str) -> None:
        """Warn with file, line and tag."""
        warnings.warn(f"{self.file}:{self.line}: <{self.tag}>: {problem}", stacklevel=2)


def nearest(given: str, valid: Collection[str]) -> str:
    """A sentence that proposes the nearest valid name, or nothing."""
    lower = {name.lower(): name for name in valid}
    near = difflib.get_close_matches(given.lower(), lower, n=1)
    return f"Did you mean {lower[near[0]]!r}? " if near else ""


def read_xml(path: Path) -> Node:
    """The root node of an XML file.

    Entities and external references are refused (they can exhaust memory or read other files).
    Raises RobotFileError when the file is missing, not XML or hostile.
    """
    handler = _Builder(path)
    try:
        defusedxml.sax.parseString(path.read_bytes(), handler)
    except OSError as error:
        raise RobotFileError(f"{path}: cannot be read ({error.strerror}). Check the path and its permissions.") from error
    except defusedxml.DefusedXmlException as error:
        raise RobotFileError(
            f"{path}:{handler.line}: entities and external references are refused ({type(error).__name__}). Write their text out."
        ) from error
    except xml.sax.SAXParseException as error:
        raise RobotFileError(
            f"{path}:{error.getLineNumber()}: not well-formed XML: {error.getMessage()} in column {(error.getColumnNumber() or 0) + 1}. "
            "Close every tag and quote every value."
        ) from error
    if handler.root is None:
        raise RobotFileError(f"{path}: holds no element.")
    return handler.root


class _Builder(xml.sax.handler.ContentHandler):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.root: Node | None = None
        self.open: list[Node] = []
        self.locator: xml.sax.xmlreader.Locator | None = None

    @property
    def line(self) -> int:
        return (self.locator.getLineNumber() or 0) if self.locator else 0

    def setDocumentLocator(self, locator: xml.sax.xmlreader.Locator) -> None:  # noqa: N802, the name is sax's
        self.locator = locator

    def startElement(self, name: str, attrs: xml.sax.xmlreader.AttributesImpl) -> None:  # noqa: N802
        node = Node(self.path, self.line, name.lower(), dict(attrs.items()))
        if len(self.open) >= DEEPEST:
            node.fail("position in the file", f"is nested more than {DEEPEST} elements deep", "Close the elements before it")
        if self.open:
            self.open[-1].children.append(node)
        else:
            self.root = node
        self.open.append(node)

    def endElement(self, name: str) -> None:  # noqa: N802
        self.open.pop()
