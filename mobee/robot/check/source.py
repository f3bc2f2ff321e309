"""What an XML file says of itself, and names that it gives and leaves empty: what its reader passes over."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.robot.check.finding import Finding
from mobee.robot.xml_node import Node, shown

VERSION = "1.0"  # of the grammar of robots and of worlds


def source(root: Node) -> Iterator[Finding]:
    """Findings in the elements of a zero-position XML file or of a world."""
    where = f"{root.file}:{root.line}"
    version = root.optional("version")
    if version not in ("", VERSION):
        yield Finding(
            "warning",
            "version",
            where,
            f"version {shown(version)!r} is not known",
            f"the file is read as version {VERSION}, which may mean something else by the same words",
            f'write version="{VERSION}" if the file keeps to it',
        )
    if root.tag != "world" and not root.optional("robotName"):
        yield Finding(
            "note",
            "robot-name",
            where,
            f"the robot has no robotName: it is called {root.file.stem!r}, after its file",
            "its name is how services find each other: copied under another name the file is another robot",
            f'add robotName="{root.file.stem}"',
        )
    yield from _empty_names(root)


def _empty_names(node: Node) -> Iterator[Finding]:
    if "name" in node.attributes and not node.optional("name") and node.tag != "world":
        yield Finding(
            "warning",
            "empty-name",
            f"{node.file}:{node.line}",
            f"<{shown(node.tag)}> has an empty name",
            "it gets a name that counts what came before it, which changes when the file does",
            "write a name, or leave the attribute out",
        )
    for child in node:
        yield from _empty_names(child)
