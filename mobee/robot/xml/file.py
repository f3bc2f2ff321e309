# SPDX-License-Identifier: Apache-2.0
"""Opens XML files; refuses missing, too large and hostile files, and repairs faults that the programs of 2010 to 2014 accepted."""

from __future__ import annotations

import os
import re
import stat
import xml.sax
import xml.sax.handler
import xml.sax.xmlreader
from dataclasses import dataclass
from pathlib import Path

import defusedxml
import defusedxml.sax

from mobee.errors import RobotFileError

LARGEST = 8_000_000  # bytes; the largest shipped file has 40 thousand
REMEDIES = {
    "encoding": "Save the file as UTF-8",
    "invalid token": 'Save the file as UTF-8 without zero bytes, and write &lt; and &amp; for "<" and "&"',
    "declaration not at start": "Remove what stands before <?xml, blank lines too",
    "no element found": "The file ends too early: close every tag, or restore it from where it came from",
    "duplicate attribute": "Remove one of the two",
    "junk after": "Put everything inside one root element",
    "undefined entity": "Write the character itself",
}


BOM_AND_BLANKS = b"\xef\xbb\xbf \t\r\n"
CONFLICT = (b"<<<<<<<", b"=======", b">>>>>>>")


class MalformedXml(RobotFileError):
    """Raised for a file that is not well-formed XML.

    `line`, `column`: of the fault, counted from 1. `problem`: the message of the parser.
    """

    def __init__(self, message: str, line: int, column: int, problem: str) -> None:
        super().__init__(message)
        self.line, self.column, self.problem = line, column, problem


class LineHandler(xml.sax.handler.ContentHandler):
    """A handler of SAX events that records the current line."""

    def __init__(self) -> None:
        super().__init__()
        self._locator: xml.sax.xmlreader.Locator | None = None

    @property
    def line(self) -> int:
        """The line of the element that is being read."""
        return (self._locator.getLineNumber() or 1) if self._locator else 1

    def setDocumentLocator(self, locator: xml.sax.xmlreader.Locator) -> None:
        """Store the locator, from which `line` is read; the SAX parser calls this before all other methods."""
        self._locator = locator


def is_file(path: Path) -> bool:
    """Return whether the path is an existing file; also False if the path cannot be checked (name too long, no permission)."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def is_folder(path: Path) -> bool:
    """Return whether the path is an existing folder; also False if the path cannot be checked (name too long, no permission)."""
    try:
        return path.is_dir()
    except (OSError, ValueError):
        return False


def parse_xml(path: Path, handler: LineHandler) -> None:
    """Parse an XML file and send its elements to the SAX handler `handler`.

    Entities and external references are refused (they can exhaust memory or read other files).
    Raises RobotFileError when the file is missing, not a regular file, larger than 8 MB, hostile or not XML.
    """
    parse_content(path, read_content(path), handler)


def parse_content(path: Path, content: bytes, handler: LineHandler) -> None:
    """Parse an XML text and send its elements to the SAX handler `handler`.

    `content`: the bytes of the file. `path`: path of the file, for messages. Raises RobotFileError if the content is not XML, or if it
    is hostile (it has entities or external references).
    """
    try:
        defusedxml.sax.parseString(content, handler)
    except defusedxml.DefusedXmlException as error:
        raise RobotFileError(
            f"{path}:{handler.line}: entities and external references are refused ({type(error).__name__}). Write their text out."
        ) from error
    except xml.sax.SAXParseException as error:
        text = content.lstrip(BOM_AND_BLANKS)
        if text and not text.startswith(b"<"):
            raise RobotFileError(
                f"{path}:1: not well-formed XML: it does not begin with '<', so it is no XML file. Give a robot, world or mesh file."
            ) from error
        line, column, problem = error.getLineNumber() or 1, (error.getColumnNumber() or 0) + 1, error.getMessage()
        remedy = next((REMEDIES[key] for key in REMEDIES if key in problem), "Close every tag and quote every value")
        if content.splitlines()[line - 1 : line] and content.splitlines()[line - 1].startswith(CONFLICT):
            problem, remedy = "a merge of git left its conflict", "Keep one side between <<<<<<< and >>>>>>>, and remove these lines"
        raise MalformedXml(f"{path}:{line}: not well-formed XML: {problem} in column {column}. {remedy}.", line, column, problem) from error
    except (LookupError, ValueError) as error:  # Python's codecs, where expat does not know the declared encoding
        raise RobotFileError(f"{path}:1: not well-formed XML: its encoding cannot be read ({error}). Save the file as UTF-8.") from error


def read_content(path: Path) -> bytes:
    """Return the bytes of a file; raises RobotFileError if it is missing, not a regular file, or larger than 8 MB."""
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            reason = os.strerror(21) if path.is_dir() else "Not a regular file"
            raise RobotFileError(f"{path}: cannot be read ({reason}). Give the path of an XML file.")
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise RobotFileError(f"{path}: cannot be read ({error.strerror}). Check the path and its permissions.") from error
    except ValueError as error:
        raise RobotFileError(f"{str(path)!r}: cannot be read ({error}). Check the path.") from error
    if len(content) > LARGEST:
        raise RobotFileError(f"{path}:1: the file is larger than {LARGEST // 1_000_000} MB. Keep meshes in files of their own.")
    return content


MOST_REPAIRS = 50  # in one file
_ATTRIBUTE = re.compile(rb"""\s*([\w:.-]+)\s*=\s*("[^"<]*"|'[^'<]*')""")


@dataclass(frozen=True, slots=True)
class Repair:
    """A repair of a faulty file.

    `line`: line of the fault. `what`: the change, in words. `remedy`: what the user can do. `error`: the error that the file would cause
    without the repair.
    """

    line: int
    what: str
    remedy: str
    error: RobotFileError


@dataclass(frozen=True, slots=True)
class Mended:
    """The content of a file after one repair, with unchanged line numbers."""

    content: bytes
    repair: Repair


def mend(content: bytes, error: RobotFileError) -> Mended | None:
    """Repair the fault that a parser reported and return the changed content.

    `content`: the bytes of the file. Only two faults are repaired, which the programs of 2010 to 2014 accepted: an attribute that is given
    twice, and bytes that are not UTF-8. Returns None for all others.
    """
    if not isinstance(error, MalformedXml):
        return None
    if error.problem == "duplicate attribute":
        return _without_second(content, error)
    if "invalid token" in error.problem:
        return _as_utf8(content, error)
    return None


def _without_second(content: bytes, error: MalformedXml) -> Mended | None:
    """Blank the attribute that begins where the parser stopped: the first of the two counts, as in Qt."""
    lines = content.split(b"\n")
    start = sum(len(line) + 1 for line in lines[: error.line - 1]) + error.column - 1
    found = _ATTRIBUTE.match(content, start)
    if found is None:
        return None
    name, blank = found.group(1).decode("utf-8", "replace"), re.sub(rb"[^\n]", b" ", found.group())
    what = f"the attribute {name!r} stands twice in one tag; the first counts"
    repair = Repair(error.line, what, "Remove one of the two", error)
    return Mended(content[:start] + blank + content[found.end() :], repair)


def _as_utf8(content: bytes, error: MalformedXml) -> Mended | None:
    """Replace bytes that are not UTF-8 by U+FFFD and report their first line; None if all bytes are UTF-8."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as wrong:
        line = content.count(b"\n", 0, wrong.start) + 1
        repair = Repair(line, "a letter is not in UTF-8; it is read as an unknown letter", "Save the file as UTF-8", error)
        return Mended(content.decode("utf-8", "replace").encode(), repair)
    return None
