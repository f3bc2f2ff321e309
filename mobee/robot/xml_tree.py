"""Writes the XML of a robot or a world: however deep it nests, and whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

from mobee.robot.xml_node import Node

VERSION = "2.0"  # of the grammar of robots and worlds that this library writes
SPELLING = {"zeropositionkinematictree": "ZeroPositionKinematicTree", "constraintlist": "constraintList", "world": "World"}


def tree_of(node: Node) -> ET.Element:
    """The elements of a node that was read, with tags in the spelling of the grammar."""
    root = ET.Element(SPELLING.get(node.tag, node.tag), node.attributes)
    waiting = [(node, root)]
    while waiting:
        source, target = waiting.pop()
        waiting += [(child, ET.SubElement(target, SPELLING.get(child.tag, child.tag), child.attributes)) for child in source]
    return root


def write_tree(root: ET.Element, path: Path, heading: str = "") -> Path:
    """Write elements with their attributes, one a line, and return the path; `heading` becomes a comment above the root.

    The standard library's writer calls itself for every level and ends at some hundred; a chain of 500 joints nests deeper.
    The file is complete or unchanged: a temporary file beside it takes its place at the end. Raises OSError.
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
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        beside.write_text("\n".join(lines) + "\n", encoding="utf-8")
        os.replace(beside, path)
    finally:
        beside.unlink(missing_ok=True)
    return path
