# SPDX-License-Identifier: Apache-2.0
"""Writes an SRDF file with groups, home and disabled pairs, and adds disabled pairs to an existing SRDF file."""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

from mobee.errors import RobotFileError
from mobee.robot.robot import Robot
from mobee.robot.urdf.pairs import adjacent_links
from mobee.robot.writing import number, write_whole
from mobee.robot.xml.node import Node, read_xml


def write_srdf(robot: Robot, masters: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Write an SRDF file with the robot's parts as groups, its home pose, and its disabled and enabled pairs of links.

    `masters`: for each motor (index of the joint that represents it in the URDF, scale, offset), with joint = scale * motor + offset.
    """
    root = ET.Element("robot", name=robot.name)
    for part in robot.parts.values():
        group = ET.SubElement(root, "group", name=part.name)
        for joint, _, _ in masters[part.slice]:
            ET.SubElement(group, "joint", name=robot.joints[joint].name)
    for part in robot.parts.values():
        state = ET.SubElement(root, "group_state", name="home", group=part.name)
        for motor, (joint, scale, offset) in zip(robot.motor_table[part.slice], masters[part.slice], strict=True):
            ET.SubElement(state, "joint", name=robot.joints[joint].name, value=number(scale * motor.home + offset))
    for pair, reason in robot.untested.items():
        first, second = (robot.links[index] for index in sorted(pair))
        ET.SubElement(root, "disable_collisions", link1=first, link2=second, reason=reason)
    for pair in adjacent_links(robot.joints, robot.shapes):
        if pair not in robot.untested:
            first, second = (robot.links[index] for index in sorted(pair))
            ET.SubElement(root, "enable_collisions", link1=first, link2=second)
    ET.indent(root, " ")
    write_whole(path, ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


NamePair = frozenset[str]
_END = re.compile(rb"[ \t]*</robot\s*>")


def write_disabled(path: Path, base: Path | None, name: str, pairs: Iterable[tuple[str, str, str]]) -> None:
    """Write an SRDF file with <disable_collisions> for `pairs` of links, each (link1, link2, reason).

    `base`: an existing SRDF whose text is kept word for word, with the new lines before its end; None: a new file for the robot `name`.
    Raises RobotFileError if lines cannot be added to that text, or if the file cannot be written; an existing file is then unchanged.
    """
    lines = [f"<disable_collisions link1={quoteattr(a)} link2={quoteattr(b)} reason={quoteattr(why)}/>" for a, b, why in pairs]
    text = _merged(base, lines) if base is not None else _begun(name, lines)
    target = path.resolve()
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".", suffix=".srdf", delete=False) as file:
            unfinished = Path(file.name)
            file.write(text)
        try:
            if target.exists():
                shutil.copymode(target, unfinished)
            else:
                unfinished.chmod(0o666 & ~_umask())
            if base is not None:
                _check(unfinished, base, lines)
            unfinished.replace(target)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        raise RobotFileError(f"{path}: cannot be written: {error.strerror or error}. Name another file: --write-srdf FILE.") from None


def disabled_and_enabled(path: Path) -> tuple[set[NamePair], set[NamePair]]:
    """Return the pairs of links in <disable_collisions>, and those in <enable_collisions>, of an SRDF file, as pairs of link names.

    Raises RobotFileError if the file cannot be read.
    """
    root = read_xml(path)
    return _pairs(root, "disable_collisions"), _pairs(root, "enable_collisions")


def _pairs(root: Node, tag: str) -> set[NamePair]:
    return {frozenset((node.optional("link1") or "", node.optional("link2") or "")) for node in root if node.tag == tag}


def _begun(name: str, lines: list[str]) -> bytes:
    return "\n".join(
        ['<?xml version="1.0" encoding="utf-8"?>', f"<robot name={quoteattr(name)}>", *(f" {line}" for line in lines), "</robot>", ""]
    ).encode()


def _merged(base: Path, lines: list[str]) -> bytes:
    """Return the text with lines inserted before its last </robot>."""
    text = base.read_bytes()
    ends = list(_END.finditer(text))
    if not ends:
        raise RobotFileError(f"{base}: has no </robot> before which lines can be put. Write <robot name=...></robot>, in UTF-8.")
    end = ends[-1]
    newline = b"\r\n" if b"\r\n" in text else b"\n"
    added = b"".join(b" " + line.encode("ascii", "xmlcharrefreplace") + newline for line in lines)
    before = text[: end.start()]
    if before and not before.endswith(b"\n"):
        before += newline
    return before + added + text[end.start() :]


def _check(unfinished: Path, base: Path, lines: list[str]) -> None:
    """Raise RobotFileError unless the new file has the elements of the old one plus the new lines.

    They differ if the last </robot> of the old file is inside a comment.
    """
    before, after = read_xml(base), read_xml(unfinished)
    if [_content(node) for node in after][: len(before.children)] != [_content(node) for node in before] or len(after.children) != len(
        before.children
    ) + len(lines):
        raise RobotFileError(f"{base}: lines cannot be put before its last </robot>. Remove what stands behind that.")


def _content(node: Node) -> tuple[object, ...]:
    return (node.tag, tuple(sorted(node.attributes.items())), tuple(_content(inner) for inner in node))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
