# SPDX-License-Identifier: Apache-2.0
"""Loads shipped worlds by name and world files by path; the grammar is in robot/worlds/README.md."""

from __future__ import annotations

from pathlib import Path

from mobee.errors import InvalidValue
from mobee.model.world import Role, World
from mobee.model.world_object import FRICTION, Geometry
from mobee.robot.load import ROBOTS, find_file, shipped
from mobee.robot.xml.node import Node, nearest, read_xml
from mobee.robot.xml.versions import WORLD_TAGS, report, upgrade_world
from mobee.robot.xml.volume import VOLUME_TAGS, read_volume

WORLDS = ROBOTS.parent / "worlds"
ROLES: dict[str, Role] = {"obstacle": "obstacle", "target": "target", "ghost": "ghost"}


def load_world(name_or_path: str | Path) -> World:
    """Load a shipped world by name (`mobee.model.world_file.shipped_worlds`), or the world of an .xml file by path.

    Raises UnknownName with the nearest shipped name, InvalidValue for an argument of another type, and RobotFileError with file, line,
    field and remedy.
    """
    return read_world(find_file(name_or_path, WORLDS, "world"))


def shipped_worlds() -> tuple[str, ...]:
    """Return the names of the worlds that come with this library, sorted."""
    return shipped(WORLDS)


def read_world(path: Path) -> World:
    """Return the world that an XML file of any version describes; the file has positions in m, root frame, and angles in degrees.

    Raises RobotFileError with file, line, field and remedy; warns of everything that is ignored or repaired.
    """
    root = read_xml(path, repair=True)
    if root.tag not in WORLD_TAGS:
        root.fail("root element", "this is not a world", "The root of a world file is <World>, or <WorldList> in files of 2011 to 2014")
    report(upgrade_world(root))
    root.check_attributes({"name", "version"})
    world = World()
    for node in root:
        if node.tag not in VOLUME_TAGS:
            _warn_unknown(node)
            continue
        node.check_attributes(VOLUME_TAGS[node.tag] | {"name", "role", "color", "mass", "friction"})
        _add(world, node)
        for child in node:
            if child.tag in VOLUME_TAGS:
                child.fail("position in the file", f"nothing stands inside <{node.tag}>", f"Move it behind the <{node.tag}>")
            _warn_unknown(child)
    return world


def _warn_unknown(node: Node) -> None:
    node.warn(f"unknown tag is ignored. {nearest(node.tag, VOLUME_TAGS)}Valid: {', '.join(sorted(VOLUME_TAGS))}")


def _add(world: World, node: Node) -> None:
    volume, name = read_volume(node), node.text("name")
    if name in world.objects:
        node.fail("name", f"a second object {name!r}", "Rename one of the two")
    role = ROLES[node.choice("role", node.attributes.get("role", "obstacle"), ROLES, "role")]
    geometry, color = Geometry(volume.kind, volume.size), _color(node)
    mass, friction = node.positive("mass", unit="kg") if "mass" in node.attributes else None, node.number("friction", FRICTION)
    if "friction" in node.attributes and mass is None:
        node.warn("friction is ignored: it counts for an object that moves, which has a mass")
    try:
        world.add(name, geometry, position=volume.centre, rotation=volume.rotation, role=role, color=color, mass=mass, friction=friction)
    except InvalidValue as error:
        node.fail("size or place", str(error).rstrip("."), "Lengths are in metres, masses in kg")


def _color(node: Node) -> list[float] | None:
    if "color" not in node.attributes:
        return None
    channels = node.numbers("color")
    if len(channels) not in (3, 4) or not all(0 <= channel <= 1 for channel in channels):
        node.fail("color", f"{node.attributes['color']!r} is no colour", "Write red, green, blue and optionally opacity, each 0 to 1")
    return channels
