"""How a file of an older version was understood, and names that are missing or empty: what its reader passes over."""

from __future__ import annotations

from collections.abc import Iterator

from mobee.robot.check.finding import Finding
from mobee.robot.xml_node import Node, descendants, shown
from mobee.robot.xml_versions import CONVERT, WORLD_TAGS, upgrade_robot, upgrade_world


def source(root: Node) -> Iterator[Finding]:
    """Findings in the elements of a zero-position XML file or of a world, which are rewritten into today's grammar on the way."""
    where = f"{root.file}:{root.line}"
    yield from _empty_names(root)
    remarks = upgrade_world(root) if root.tag in WORLD_TAGS else upgrade_robot(root)
    for remark in remarks:
        if remark.severity == "note":  # of the others its reader has warned
            yield Finding(
                "note",
                "older-version",
                f"{remark.node.file}:{remark.node.line}",
                remark.what,
                "the file is of an older version, and this is how it was understood",
                remark.remedy or CONVERT,
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


def _empty_names(root: Node) -> Iterator[Finding]:
    for node in descendants(root):
        if "name" in node.attributes and not node.optional("name") and node.tag != "world":
            yield Finding(
                "warning",
                "empty-name",
                f"{node.file}:{node.line}",
                f"<{shown(node.tag)}> has an empty name",
                "it gets a name that counts what came before it, which changes when the file does",
                "write a name, or leave the attribute out",
            )
