"""What hangs on a link or joint: volumes, the skeleton's own volume, markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mobee.robot.robot import Array, Marker, Shape
from mobee.robot.xml_convex import read_convex
from mobee.robot.xml_draft import Draft, Place
from mobee.robot.xml_node import Node
from mobee.robot.xml_volume import PLACE, X, Z, align, direction, read_volume

MOST_SHAPES = 2000  # what is tested grows with the square


def read_skeleton(node: Node, draft: Draft, place: Place, centre: Array, axis: Array, length: float) -> None:
    """The cylinders that `radius` and `field` of a link or joint stand for."""
    for attribute, role in (("radius", "solid"), ("field", "field")):
        if node.number(attribute, 0.0) == 0:
            continue
        if length == 0:
            node.fail(attribute, "a link without length has no volume", f"Remove {attribute} or give x, y, z")
        rotation = align(Z, axis / np.linalg.norm(axis))
        name = node.optional("name") or f"{draft.links[place.link]}_{node.tag}"
        shape = Shape(
            free_name(draft, name if role == "solid" else f"{name}_field"),
            place.link,
            "cylinder",
            (node.positive(attribute), length),
            centre,
            rotation,
            "solid" if role == "solid" else "field",
            place.part,
        )
        add_shape(node, draft, shape, place)


def read_shape(node: Node, draft: Draft, place: Place) -> None:
    """Add the solid or field of a <sphere>, <capsule>, <cylinder>, <box> or <convex>."""
    volume = read_convex(node) if node.tag == "convex" else read_volume(node)
    name = node.optional("name") or free_name(draft, f"{draft.links[place.link]}_{node.tag}")
    if name in draft.shape_names:
        node.fail("name", f"a second shape {name!r}", "Rename one of the two")
    role = "field" if node.flag("field") else "solid"
    centre = place.start + volume.centre
    link = place.link if node.flag("turns", default=True) else place.carrier
    shape = Shape(name, link, volume.kind, volume.size, centre, volume.rotation, "solid", place.part, volume.vertices)
    place = replace(place, base=node.flag("base", default=place.base))
    add_shape(node, draft, replace(shape, role="field") if role == "field" else shape, place)


def add_shape(node: Node, draft: Draft, shape: Shape, place: Place) -> None:
    """Append a shape, remembering its line, its element and whether it belongs to the base."""
    if len(draft.shapes) >= MOST_SHAPES:
        node.fail("size of the file", f"more than {MOST_SHAPES} shapes", "Join small shapes, or leave out what nothing can touch")
    if place.base:
        draft.base_shapes.add(len(draft.shapes))
    draft.shapes.append(shape)
    draft.shape_names[shape.name] = 0
    draft.note("shape", shape.name, node)
    draft.hosts.append(place.element)


def free_name(draft: Draft, name: str) -> str:
    """The name, with a number behind it if a shape has it already."""
    free = name
    while free in draft.shape_names:
        free = f"{name}_{draft.shape_names[name]}"
        draft.shape_names[name] += 1
    return free


def read_marker(node: Node, draft: Draft, place: Place) -> None:
    """Add a <marker>; its normal is +x, or the z axis of its rotation; without a rotation z is turned the shortest way to the normal."""
    name = node.text("name")
    if name in draft.markers:
        node.fail("name", f"a second marker {name!r}", "Rename one of the two")
    given = any(axis in node.attributes for axis in ("nx", "ny", "nz"))
    normal = direction(node, ("nx", "ny", "nz")) if given else X
    rotation = align(Z, normal)
    if "rotation" in node.attributes:
        rotation = np.array(node.numbers("rotation", 9)).reshape(3, 3)
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0:
            node.fail("rotation", "is not a rotation matrix", "Write a right-handed orthonormal 3 x 3 matrix row by row")
        left, _, right = np.linalg.svd(rotation)  # the nearest exact rotation to what the digits of the file say
        rotation = left @ right
        normal = normal if given else rotation[:, 2]
    draft.note("marker", name, node)
    link = place.link if node.flag("turns", default=True) else place.carrier
    draft.markers[name] = Marker(name, link, place.start + node.vector(PLACE), rotation, normal)
