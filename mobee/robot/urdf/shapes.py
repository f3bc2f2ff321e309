# SPDX-License-Identifier: Apache-2.0
"""Reads solids and visuals of a URDF, and generates fields (volumes that cause repulsive forces) around the solids.

Solids are from the <collision> elements. A faulty <visual> element causes only a warning, since the robot moves without it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, RobotFileError, Simplified
from mobee.robot.robot import Channels, MeshSource, Shape, Visual, VisualKind
from mobee.robot.urdf.hull import Corners, convex_hull, smallest, smallest_capsule
from mobee.robot.urdf.layout import Skeleton
from mobee.robot.urdf.mesh import find_mesh, read_mesh
from mobee.robot.urdf.tree import Frame, Tree, check_spelling, child, read_origin, triple
from mobee.robot.xml.body import MOST_SHAPES
from mobee.robot.xml.node import SMALLEST, Node, descendants, nearest

Meshes = Literal["hull", "bounding"]
MESH_ATTRIBUTES = ("filename", "scale")
GEOMETRIES = ("sphere", "cylinder", "capsule", "box", "mesh")
LINK_TAGS = ("inertial", "visual", "collision", "contact", "mobee")
LARGEST = 1e4  # m
CLOSE = 1e-9  # m, for the ends of a cylinder that carries two spheres as caps
MOST_VISUALS = 2000


@dataclass(frozen=True, slots=True, eq=False)
class Found:
    """A shape that was read from a file.

    `node`: its XML element with file and line. `base`: whether it belongs to the robot's base, which is never tested against world objects.
    """

    node: Node
    shape: Shape
    base: bool


@dataclass(slots=True, eq=False)
class ShapeReader:
    """Reads the shapes of one robot; each mesh file is opened once.

    `meshes`: "hull" (a mesh becomes its convex hull) or "bounding" (the smallest primitive around it). `corners`: largest number of
    corners of a hull, or "all". `parts`: names of the robot's parts. `known`: the hulls that were computed, by file and scale. `count`:
    number of shapes that were read.
    """

    meshes: Meshes
    corners: Corners
    parts: Collection[str]
    known: dict[tuple[Path, tuple[float, ...]], Array] = field(default_factory=dict)
    count: int = 0

    def read(self, link: Node, index: int, frame: Frame, part: str) -> list[Found]:
        """Return the solids of a <link> element, and the fields that `mobee.robot.urdf.write.write_urdf` added to it.

        Fields are volumes that cause repulsive forces. `index`: index of the robot's link. `frame`: frame of the link at zero pose, in the
        root frame. `part`: name of the part of its shapes. Raises RobotFileError for faulty elements and for meshes that cannot be read.
        """
        found: list[Found] = []
        for node in link:
            if node.tag not in LINK_TAGS and nearest(node.tag, LINK_TAGS):
                node.warn(f"unknown tag is ignored. {nearest(node.tag, LINK_TAGS)}")
            if node.tag == "collision":
                found.append(self._read(node, node.optional("name") or link.text("name"), child(node, "mobee"), index, frame, part))
            elif node.tag == "mobee" and "field" in node.attributes:
                one = self._read(node, node.text("field"), node, index, frame, part)
                found.append(replace(one, shape=replace(one.shape, role="field")))
        return _capsules(found)

    def _read(self, node: Node, name: str, note: Node | None, link: int, frame: Frame, part: str) -> Found:
        self.count += 1
        if self.count > MOST_SHAPES:
            node.fail("size of the file", f"more than {MOST_SHAPES} shapes", "Join small shapes, or leave out what nothing can touch")
        base = link == 0
        if note is not None:
            note.check_attributes({"field", "part", "base", "capsule"})
            part = note.attributes.get("part", part)
            part = part and note.choice("part", part, self.parts, "part")
            base = note.flag("base", default=base)
        place = frame @ read_origin(node)
        shape = Shape(name, link, "sphere", (), place.position, place.rotation, "solid", part)
        return Found(node, self._shaped(node, shape), base)

    def _shaped(self, node: Node, shape: Shape) -> Shape:
        geometry = child(node, "geometry")
        forms = [form for form in geometry or () if form.tag in GEOMETRIES]
        if len(forms) != 1:
            given = ", ".join(form.tag for form in geometry or ()) or "nothing"
            near = "".join(nearest(form.tag, GEOMETRIES) for form in geometry or ())
            node.fail("geometry", f"holds {given}", f"{near}Write one of {', '.join(GEOMETRIES)} inside <geometry>")
        form = forms[0]
        match form.tag:
            case "sphere":
                return replace(shape, kind="sphere", size=(_length(form, "radius"),))
            case "cylinder":
                return replace(shape, kind="cylinder", size=(_length(form, "radius"), _length(form, "length")))
            case "capsule":
                return replace(shape, kind="capsule", size=(_length(form, "radius"), _length(form, "length")))
            case "box":
                x, y, z = triple(form, "size")
                if min(x, y, z) < SMALLEST or max(x, y, z) > LARGEST:
                    form.fail("size", f"{x:g} {y:g} {z:g} is no box", "Write three edges above 0, in metres")
                return replace(shape, kind="box", size=(float(x), float(y), float(z)))
        return self._mesh(form, shape)

    def _mesh(self, form: Node, shape: Shape) -> Shape:
        check_spelling(form, MESH_ATTRIBUTES)
        scale = triple(form, "scale") if "scale" in form.attributes else np.ones(3)
        if np.abs(scale).min() < SMALLEST:
            form.fail("scale", "has a factor of 0", "Write three factors such as 0.001 0.001 0.001")
        key = (find_mesh(form), tuple(scale.tolist()))
        if key not in self.known:
            points = _points(form, key[0]) * scale
            if not LARGEST >= float(np.ptp(points, axis=0).max()) >= SMALLEST:
                extent = float(np.ptp(points, axis=0).max())
                form.fail("scale", f"the mesh is {extent:g} m long", "Correct the scale: URDF counts in metres")
            try:
                self.known[key] = convex_hull(points, self.corners)
            except InvalidValue as error:
                form.fail("filename", str(error), "Export the mesh again, or draw a box or cylinder instead")
        return hulled(shape, self.known[key], self.meshes)


def hulled(shape: Shape, vertices: Array, meshes: Meshes) -> Shape:
    """Return a copy of the shape with the form of a convex hull, or with that of the smallest primitive around the hull.

    `vertices`: (v, 3) m, corners of the hull, in the frame of the shape. `meshes`: "hull" or "bounding" (primitive).
    """
    frame = Frame(shape.position, shape.rotation)
    if meshes == "bounding":
        fit = smallest(vertices)
        place = frame @ Frame(fit.centre, fit.rotation)
        return replace(shape, kind=fit.kind, size=fit.size, position=place.position, rotation=place.rotation)
    centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
    place = frame @ Frame(centre, np.eye(3))
    return replace(shape, kind="convex", position=place.position, vertices=vertices - centre)


def _points(form: Node, path: Path) -> Array:
    try:
        return read_mesh(path)
    except RobotFileError as error:
        raise RobotFileError(f"{error} The robot names it in {form.file}:{form.line}: <mesh>.") from error


def _length(form: Node, name: str) -> float:
    value = form.positive(name)
    if value > LARGEST:
        form.fail(name, f"{value:g} m is too long", "URDF counts in metres")
    return value


def _capsules(found: list[Found]) -> list[Found]:
    """Replace each solid cylinder with a sphere of its radius at both ends by a capsule, for which URDF has no element.

    Of several spheres at one end, the one that `write_urdf` named after the cylinder is taken. A cylinder with <mobee capsule="false"/>
    remains one.
    """
    spheres = [k for k, one in enumerate(found) if one.shape.kind == "sphere" and one.shape.role == "solid"]
    if len(spheres) < 2:
        return found
    caps: set[int] = set()
    merged = list(found)
    balls = np.array([[*found[k].shape.position, found[k].shape.size[0]] for k in spheres])
    for k, one in enumerate(found):
        if one.shape.kind != "cylinder" or one.shape.role != "solid":
            continue
        note = child(one.node, "mobee")
        if note is not None and not note.flag("capsule", default=True):
            continue
        radius, height = one.shape.size
        half = height / 2.0 * one.shape.rotation[:, 2]
        ends = [np.append(one.shape.position + side * half, radius) for side in (1.0, -1.0)]
        at_ends = [[spheres[ball] for ball in np.flatnonzero(np.abs(balls - end).max(axis=1) < CLOSE)] for end in ends]
        if all(at_ends):
            names = [f"{one.shape.name}_cap_{side}" for side in (0, 1)]
            caps |= {min(here, key=lambda ball: found[ball].shape.name != name) for here, name in zip(at_ends, names, strict=True)}
            merged[k] = replace(one, shape=replace(one.shape, kind="capsule"))
    return [one for k, one in enumerate(merged) if k not in caps]


def grown(shape: Shape, by: float, name: str) -> Shape:
    """Return a field around a solid: the same shape, larger by `by` m on all sides; around a convex shape (a mesh) it is a capsule.

    A field is a volume that causes a repulsive force. `name`: name of the field. Raises ValueError for a convex shape without vertices.
    """
    around = replace(shape, name=name, role="field")
    match shape.kind:
        case "sphere" | "capsule":
            return replace(around, size=(shape.size[0] + by, *shape.size[1:]))
        case "cylinder":
            return replace(around, size=(shape.size[0] + by, shape.size[1] + 2 * by))
        case "box":
            return replace(around, size=tuple(edge + 2 * by for edge in shape.size))
    vertices = shape.vertices
    if vertices is None:
        raise ValueError(f"the convex shape {shape.name!r} has no vertices")
    fit = smallest_capsule(vertices)
    place = Frame(shape.position, shape.rotation) @ Frame(fit.centre, fit.rotation)
    size = (fit.size[0] + by, fit.size[1])
    return replace(around, kind="capsule", size=size, position=place.position, rotation=place.rotation, vertices=None)


def read_visuals(robot: Node, tree: Tree, skeleton: Skeleton) -> tuple[Visual, ...]:
    """Return the visuals of all links of a URDF; an element that cannot be drawn causes a warning (`Simplified`) of one line.

    `robot`: the root element. `skeleton`: the tree at zero pose.
    """
    materials = _materials(robot)
    found: list[Visual] = []
    for link, index in skeleton.index.items():
        for node in tree.links[link]:
            if node.tag != "visual":
                continue
            if len(found) >= MOST_VISUALS:
                node.warn(f"is not drawn, nor are the others after it: a robot has at most {MOST_VISUALS} visuals", Simplified)
                return tuple(found)
            try:
                found += _read(node, index, skeleton.frames[link], materials)
            except RobotFileError as error:
                node.warn(f"is not drawn: {str(error).partition('> ')[2] or error}", Simplified)
    return tuple(found)


def _materials(robot: Node) -> dict[str, Node]:
    """Return the <color> of each material by its name; a material may be defined in the root, or in the first link that uses it."""
    found: dict[str, Node] = {}
    for material in descendants(robot):
        if material.tag == "material" and material.optional("name"):
            for color in material:
                if color.tag == "color":
                    found.setdefault(material.optional("name"), color)
    return found


def _read(node: Node, link: int, frame: Frame, materials: Mapping[str, Node]) -> Iterator[Visual]:
    place = frame @ read_origin(node)
    color = _color(node, materials)
    for form in child(node, "geometry") or ():
        kind: VisualKind
        size: tuple[float, ...]
        mesh: MeshSource | None = None
        match form.tag:
            case "sphere":
                kind, size = "sphere", (form.positive("radius"),)
            case "cylinder":
                kind, size = "cylinder", (form.positive("radius"), form.positive("length"))
            case "capsule":
                kind, size = "capsule", (form.positive("radius"), form.positive("length"))
            case "box":
                x, y, z = np.maximum(np.abs(triple(form, "size")), SMALLEST).tolist()
                kind, size = "box", (x, y, z)
            case "mesh":
                check_spelling(form, MESH_ATTRIBUTES)
                x, y, z = (triple(form, "scale") if "scale" in form.attributes else np.ones(3)).tolist()
                kind, size = "mesh", ()
                mesh = MeshSource(form.text("filename"), Path(form.file), form.line, scale=(x, y, z))
            case _:
                continue
        yield Visual(link, kind, size, place.position, place.rotation, color, mesh)


def _color(node: Node, materials: Mapping[str, Node]) -> Channels | None:
    """Return the colour of the <material>, by itself or by its name; None if it has none."""
    material = child(node, "material")
    if material is None:
        return None
    given = child(material, "color") or materials.get(material.optional("name"))
    if given is None or "rgba" not in given.attributes:
        return None
    red, green, blue, opacity = np.clip(given.numbers("rgba", 4), 0.0, 1.0).tolist()
    return red, green, blue, opacity
