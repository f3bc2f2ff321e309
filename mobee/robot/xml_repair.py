"""Mends faults of form that the XML reader of 2010 to 2014 (Qt's) let pass, and says what it did."""

from __future__ import annotations

import re
from dataclasses import dataclass

from mobee.errors import RobotFileError
from mobee.robot.xml_file import MalformedXml

MOST_REPAIRS = 50  # in one file
_ATTRIBUTE = re.compile(rb"""\s*([\w:.-]+)\s*=\s*("[^"<]*"|'[^'<]*')""")


@dataclass(frozen=True, slots=True)
class Repair:
    """What was mended in which line, and the error that it would have been."""

    line: int
    what: str
    remedy: str
    error: RobotFileError


@dataclass(frozen=True, slots=True)
class Mended:
    """The content of a file after one repair; no line has moved."""

    content: bytes
    repair: Repair


def mend(content: bytes, error: RobotFileError) -> Mended | None:
    """The content without the fault that a parser reported; None where the old reader refused the file too."""
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
    """Read bytes that are not UTF-8 as unknown letters."""
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as wrong:
        line = content.count(b"\n", 0, wrong.start) + 1
        repair = Repair(line, "a letter is not in UTF-8; it is read as an unknown letter", "Save the file as UTF-8", error)
        return Mended(content.decode("utf-8", "replace").encode(), repair)
    return None
