# SPDX-License-Identifier: Apache-2.0
"""Reads the elements on a link or joint: volumes, hulls, masses, markers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from mobee.arrays import Array
from mobee.robot.bodies import from_six
from mobee.robot.robot import Body, Marker, Shape
from mobee.robot.xml.draft import Draft, Place
from mobee.robot.xml.node import Node
from mobee.robot.xml.volume import AXIS, PLACE, Volume, X, Z, align, box_rotation, direction, read_volume

MASS_ATTRIBUTES = frozenset({"value", "inertia", *PLACE})
HEAVIEST = 1e6  # kg


def read_mass(node: Node, draft: Draft, place: Place) -> None:
    """Read a <mass> and add it to `draft`, the robot read so far; raises RobotFileError if it is not valid.

    Several masses on one link are added up later. `place`: position of the <mass> in the tree of the file.
    """
    mass = node.positive("value", unit="kilograms")
    if mass > HEAVIEST:
        node.fail("value", f"{mass:g} is too large", "Masses are in kilograms")
    inertia = from_six(node.numbers("inertia", 6)) if "inertia" in node.attributes else None
    draft.bodies.append(Body(place.link, mass, place.start + node.vector(PLACE), inertia))


CONVEX_ATTRIBUTES = frozenset({"points", "angle", *PLACE, *AXIS})
MOST_POINTS = 10_000
FLAT = 1e-6  # a hull thinner than this part of its length has no inside that a collision test could find


def read_convex(node: Node) -> Volume:
    """Return the volume of a <convex> element, whose attribute `points` has x y z [m] of each corner relative to its centre.

    Its rotation is that of a <box> with the same attributes (`mobee.robot.xml.volume.box_rotation`). Raises RobotFileError for too few or
    too many points, or points in one plane.
    """
    numbers = node.numbers("points")
    if len(numbers) % 3 or not 4 <= len(numbers) // 3 <= MOST_POINTS:
        node.fail("points", f"has {len(numbers)} numbers", f"Write x y z of 4 to {MOST_POINTS} points, separated by blanks")
    vertices: Array = np.array(numbers).reshape(-1, 3)
    extent = np.linalg.svd(vertices - vertices.mean(axis=0), compute_uv=False)
    if extent[2] <= max(FLAT * extent[0], 1e-9):
        node.fail("points", "all lie in one plane", "Give the hull a thickness, or write a thin <box>")
    return Volume("convex", (), node.vector(PLACE), box_rotation(node), vertices)


MOST_SHAPES = 2000  # the number of tested pairs grows with the square


def read_skeleton(node: Node, draft: Draft, place: Place, centre: Array, axis: Array, length: float) -> None:
    """Add the solid and the field that the attributes `radius` and `field` of a <link> or <joint> describe.

    They are added to `draft`, the robot read so far. Both are cylinders; a field is a volume that causes a repulsive force. `centre`: (3,)
    m, of the cylinders, root frame. `axis`: (3,), direction of their axis, not necessarily a unit vector. `length`: their length, m.
    `place`: position of the element in the tree of the file. Raises RobotFileError if the element is not valid.
    """
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
    """Read a <sphere>, <capsule>, <cylinder>, <box> or <convex>, and add its solid or field to `draft`, the robot read so far.

    A field, a shape with the attribute `field`, is a volume that causes a repulsive force. `place`: position of the element in the
    tree of the file. Raises RobotFileError if the element is not valid.
    """
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
    """Add a shape to `draft`, the robot read so far; raises RobotFileError if there are too many shapes.

    The line of `node` in the file, the index of the current element, and whether the shape belongs to the base are recorded too.
    `place`: position of the element in the tree of the file.
    """
    if len(draft.shapes) >= MOST_SHAPES:
        node.fail("size of the file", f"more than {MOST_SHAPES} shapes", "Join small shapes, or leave out what nothing can touch")
    if place.base:
        draft.base_shapes.add(len(draft.shapes))
    draft.shapes.append(shape)
    draft.shape_names[shape.name] = 0
    draft.note("shape", shape.name, node)
    draft.hosts.append(place.element)


def free_name(draft: Draft, name: str) -> str:
    """Return the name, with a number appended if a shape of `draft`, the robot read so far, already has it."""
    free = name
    while free in draft.shape_names:
        free = f"{name}_{draft.shape_names[name]}"
        draft.shape_names[name] += 1
    return free


def read_marker(node: Node, draft: Draft, place: Place) -> None:
    """Read a <marker> and add it to `draft`, the robot read so far; raises RobotFileError if it is not valid.

    Without a normal in the file the normal is the z axis of the marker's rotation, or +x if there is no rotation either. Without a
    rotation in the file it is the smallest rotation that turns z to the normal. `place`: position of the <marker> in the tree of the file.
    """
    name = node.text("name")
    if name in draft.markers:
        node.fail("name", f"a second marker {name!r}", "Rename one of the two")
    given = any(axis in node.attributes for axis in ("nx", "ny", "nz"))
    normal = direction(node, ("nx", "ny", "nz")) if given else X
    rotation = align(Z, normal)
    if "rotation" in node.attributes:
        rotation = read_rotation(node)
        normal = normal if given else rotation[:, 2]
    draft.note("marker", name, node)
    link = place.link if node.flag("turns", default=True) else place.carrier
    draft.markers[name] = Marker(name, link, place.start + node.vector(PLACE), rotation, normal)


def read_rotation(node: Node) -> Array:
    """Return the rotation (3, 3) in the attribute `rotation`, nine numbers row by row, corrected for the rounding in the file.

    Raises RobotFileError if it is not a rotation matrix.
    """
    rotation: Array = np.array(node.numbers("rotation", 9)).reshape(3, 3)
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-4 or np.linalg.det(rotation) < 0:
        node.fail("rotation", "is not a rotation matrix", "Write a right-handed orthonormal 3 x 3 matrix row by row")
    left, _, right = np.linalg.svd(rotation)  # the nearest exact rotation to the rounded one in the file
    return np.asarray(left @ right)
