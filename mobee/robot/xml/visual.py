# SPDX-License-Identifier: Apache-2.0
"""Reads and writes the <visual> and <camera> tags of links."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from mobee.arrays import Array
from mobee.robot.cameras import VIEW, upright
from mobee.robot.robot import Robot
from mobee.robot.urdf.mesh import mesh_name
from mobee.robot.visual import Camera, Channels, MeshSource, Visual, VisualKind
from mobee.robot.writing import number, numbers
from mobee.robot.xml.body import read_rotation
from mobee.robot.xml.draft import Draft, Place
from mobee.robot.xml.node import Node
from mobee.robot.xml.volume import PLACE, direction

NORMAL = ("nx", "ny", "nz")
VISUAL_ATTRIBUTES = frozenset({"file", "mesh", "scale", "shape", "size", "color", "rotation", "turns", *PLACE})
CAMERA_ATTRIBUTES = frozenset({"name", "view", "hides", "rotation", "turns", *NORMAL, *PLACE})
SIZES: dict[VisualKind, int] = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
NARROWEST, WIDEST = 1.0, 170.0  # degrees


def read_visual(node: Node, draft: Draft, place: Place) -> None:
    """Read a <visual> (a mesh file, or a shape with its size in m) and add it to the draft; raises RobotFileError if it is not valid.

    `draft`: the elements of the robot file that were read so far. `place`: position of the <visual> in the tree of the file.
    """
    rotation = read_rotation(node) if "rotation" in node.attributes else np.eye(3)
    link = place.link if node.flag("turns", default=True) else place.carrier
    kind: VisualKind = "mesh"
    size: tuple[float, ...] = ()
    mesh = None
    if "file" in node.attributes:
        x, y, z = node.numbers("scale", 3) if "scale" in node.attributes else (1.0, 1.0, 1.0)
        mesh = MeshSource(node.text("file"), node.file, node.line, node.optional("mesh"), (x, y, z))
    else:
        if "shape" not in node.attributes:
            node.missing("file")
        kind = next(known for known in SIZES if known == node.choice("shape", node.text("shape"), SIZES, "shape"))
        size = tuple(node.numbers("size", SIZES[kind]))
        if min(size) <= 0.0:
            node.fail("size", f"{min(size):g} is not positive", "Write lengths above 0, in metres")
    draft.visuals.append(Visual(link, kind, size, place.start + node.vector(PLACE), rotation, _color(node), mesh))


def _color(node: Node) -> Channels | None:
    if "color" not in node.attributes:
        return None
    red, green, blue, opacity = node.numbers("color", 4)
    if not 0.0 <= min(red, green, blue, opacity) <= max(red, green, blue, opacity) <= 1.0:
        node.fail("color", "is not between 0 and 1", "Write red, green, blue and opacity, each from 0 to 1")
    return red, green, blue, opacity


def read_camera(node: Node, draft: Draft, place: Place) -> None:
    """Read a <camera> and add it to the draft; raises RobotFileError if it is not valid.

    The camera has the rotation of the file. Without one its direction of view is the vector (nx, ny, nz) in the root frame, or -x if this
    is absent too, and its picture is upright at zero pose. `draft`: the elements of the robot file that were read so far. `place`: position
    of the <camera> in the tree of the file.
    """
    name = node.text("name")
    if name in draft.cameras:
        node.fail("name", f"a second camera {name!r}", "Rename one of the two")
    if "rotation" in node.attributes:
        rotation = read_rotation(node)
    else:
        rotation = upright(direction(node, NORMAL, (-1.0, 0.0, 0.0)))
    view = node.number("view", VIEW)
    if not NARROWEST <= view <= WIDEST:
        node.fail("view", f"{view:g} deg is no field of view", f"Write degrees from {NARROWEST:g} to {WIDEST:g}")
    link = place.link if node.flag("turns", default=True) else place.carrier
    draft.cameras[name] = Camera(name, link, place.start + node.vector(PLACE), rotation, view)
    draft.hides[name] = (node, tuple(node.words("hides")) if "hides" in node.attributes else ())
    draft.note("camera", name, node)


def finished_cameras(draft: Draft) -> dict[str, Camera]:
    """Return the cameras of a robot, by name, each with the links that are not drawn in its pictures (`Camera.hidden`).

    `draft`: all elements of the robot's file. Raises RobotFileError for a link that the robot does not have.
    """
    found = {}
    for name, camera in draft.cameras.items():
        node, links = draft.hides[name]
        hidden = frozenset(draft.links.index(node.choice("hides", link, draft.links, "link")) for link in links)
        found[name] = Camera(name, camera.link, camera.position, camera.rotation, camera.view_deg, hidden)
    return found


def visual_elements(robot: Robot, link: int, origin: Array, path: Path) -> Iterable[ET.Element]:
    """Yield the <visual> and <camera> elements of a link.

    `link`: its index. `origin`: (3,) m, root frame at zero pose, the point to which the positions in the file are relative. `path`: path of
    the file into which the elements are written.
    """
    for visual in robot.visuals:
        if visual.link == link:
            what = _mesh(visual.mesh, path) if visual.mesh else {"shape": visual.kind, "size": numbers(visual.size)}
            color = {} if visual.color is None else {"color": numbers(visual.color)}
            yield ET.Element("visual", what | _placed(visual.position - origin, visual.rotation) | color)
    for camera in robot.cameras.values():
        if camera.link == link:
            hides = " ".join(robot.links[one] for one in sorted(camera.hidden))
            rest = {"view": number(camera.view_deg)} | ({"hides": hides} if hides else {})
            yield ET.Element("camera", {"name": camera.name} | _placed(camera.position - origin, camera.rotation) | rest)


def _placed(position: Array, rotation: Array) -> dict[str, str]:
    place = {name: number(value) for name, value in zip(PLACE, position.tolist(), strict=True)}
    return place | ({} if np.array_equal(rotation, np.eye(3)) else {"rotation": numbers(rotation.reshape(9))})


def _mesh(mesh: MeshSource, path: Path) -> dict[str, str]:
    name = {"mesh": mesh.name} if mesh.name else {}
    scale = {} if mesh.scale == (1.0, 1.0, 1.0) else {"scale": numbers(mesh.scale)}
    return {"file": mesh_name(mesh, path)} | name | scale
