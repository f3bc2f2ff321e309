# SPDX-License-Identifier: Apache-2.0
"""Reads the elements on a link or joint (volumes, hulls, masses, markers, visuals, cameras) into a draft, the robot read so far."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from mobee.arrays import Array
from mobee.robot.bodies import from_six
from mobee.robot.cameras import VIEW, upright
from mobee.robot.join import Placed
from mobee.robot.pairs_2014 import Element
from mobee.robot.robot import Body, Camera, Channels, Joint, Marker, MeshSource, Shape, Visual, VisualKind
from mobee.robot.xml.motors import MotorDraft
from mobee.robot.xml.node import Node
from mobee.robot.xml.volume import AXIS, PLACE, Volume, X, Z, align, box_rotation, direction, read_volume

MASS_ATTRIBUTES = frozenset({"value", "inertia", *PLACE})
HEAVIEST = 1e6  # kg
CONVEX_ATTRIBUTES = frozenset({"points", "angle", *PLACE, *AXIS})
MOST_POINTS = 10_000
FLAT = 1e-6  # a hull thinner than this part of its length has no inside that a collision test could find
MOST_SHAPES = 2000  # the number of tested pairs grows with the square
NORMAL = ("nx", "ny", "nz")
VISUAL_ATTRIBUTES = frozenset({"file", "mesh", "scale", "shape", "size", "color", "rotation", "turns", *PLACE})
CAMERA_ATTRIBUTES = frozenset({"name", "view", "hides", "rotation", "turns", *NORMAL, *PLACE})
SIZES: dict[VisualKind, int] = {"sphere": 1, "capsule": 2, "cylinder": 2, "box": 3, "ellipsoid": 3}
NARROWEST, WIDEST = 1.0, 170.0  # degrees, the field of view of a camera


@dataclass(slots=True)
class Draft:
    """The elements of a robot file that were read so far; indices as in `mobee.robot.robot.Robot`.

    `subtree`: for each link, the index of the element above it that has the attribute noSelfCollision, -1: none; the shapes below such an
    element, usually a hand, are not tested for contacts with each other. `drives`: for each joint, its XML element and the name of its
    motor. `parts`: name -> its XML elements. `hands`: dict from the index of an element with noSelfCollision to its name, for texts that
    state why two links are not tested for contacts. `elements`: the root, and all <link> and <joint> elements. `hosts`: for each shape, the
    index of its element. `shape_names`: name of a shape -> the number that is appended if another shape gets this name. `base_shapes`:
    indices of shapes that are not tested against world objects. `hides`: camera -> its XML element, and the names of the links that it does
    not show. `constraints`: part and XML element of each <constraintList>, a condition on motor positions. `ignores`: the <ignore>
    elements, which name pairs that are not tested for contacts. `others`: included robots, with the XML elements that include them.
    `where`: (kind, name) -> "file:line".
    """

    links: list[str] = field(default_factory=lambda: ["base"])
    subtree: list[int] = field(default_factory=lambda: [-1])
    joints: list[Joint] = field(default_factory=list)
    drives: list[tuple[Node, str]] = field(default_factory=list)
    motors: dict[str, MotorDraft] = field(default_factory=dict)
    parts: dict[str, list[Node]] = field(default_factory=dict)
    hands: dict[int, str] = field(default_factory=dict)
    elements: list[Element] = field(default_factory=lambda: [Element(-1, "link", "", -1)])
    shapes: list[Shape] = field(default_factory=list)
    hosts: list[int] = field(default_factory=list)
    shape_names: dict[str, int] = field(default_factory=dict)
    base_shapes: set[int] = field(default_factory=set)
    markers: dict[str, Marker] = field(default_factory=dict)
    bodies: list[Body] = field(default_factory=list)  # perhaps several for one link
    visuals: list[Visual] = field(default_factory=list)
    cameras: dict[str, Camera] = field(default_factory=dict)
    hides: dict[str, tuple[Node, tuple[str, ...]]] = field(default_factory=dict)
    constraints: list[tuple[str, Node]] = field(default_factory=list)
    ignores: list[Node] = field(default_factory=list)
    others: list[tuple[Node, Placed]] = field(default_factory=list)
    where: dict[tuple[str, str], str] = field(default_factory=dict)

    def note(self, kind: str, name: str, node: Node) -> None:
        """Record file and line of an element in `where`, unless an element of this kind and name is recorded already."""
        self.where.setdefault((kind, name), f"{node.file}:{node.line}")


@dataclass(frozen=True, slots=True)
class Place:
    """The position of the reader in the tree of a file.

    `point`: (3,) m, root frame, the end of the current <link>, at which the links and joints inside it are attached. `start`: (3,) m, root
    frame, the start of this <link>, to which its shapes and markers are relative. `link`: index of the robot's link. `carrier`: index of
    the link to which elements with turns="false" belong: directly inside a <joint> it is the link that carries the joint, elsewhere it is
    `link`. `part`, `motor`: names of the current part and motor, "": none. `subtree`: index of the outermost element around this
    position that has the attribute noSelfCollision (see `Draft`), -1: none. `base`: whether shapes here belong to the robot's base, which
    is never tested against world objects (`Draft.base_shapes`). `element`: index of the current element in `Draft.elements`.
    """

    point: Array
    start: Array
    link: int = 0
    carrier: int = 0
    part: str = ""
    motor: str = ""
    subtree: int = -1
    base: bool = True
    element: int = 0


def enter(node: Node, draft: Draft, place: Place, name: str) -> Place:
    """Add a <link> or <joint> to the elements of the draft and return the position of the reader inside it.

    `place`: position outside it. `name`: name of the element, for texts that state why two links are not tested for contacts.
    """
    index = len(draft.elements)
    if node.flag("noSelfCollision") and place.subtree < 0:
        draft.hands[index] = name
        place = replace(place, subtree=index)
    draft.elements.append(Element(place.element, node.tag, place.part, place.subtree, place.link))
    return replace(place, element=index)


def read_mass(node: Node, draft: Draft, place: Place) -> None:
    """Read a <mass> and add it to `draft`, the robot read so far; raises RobotFileError if it is not valid.

    Several masses on one link are added up later. `place`: position of the <mass> in the tree of the file.
    """
    mass = node.positive("value", unit="kilograms")
    if mass > HEAVIEST:
        node.fail("value", f"{mass:g} is too large", "Masses are in kilograms")
    inertia = from_six(node.numbers("inertia", 6)) if "inertia" in node.attributes else None
    draft.bodies.append(Body(place.link, mass, place.start + node.vector(PLACE), inertia))


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
