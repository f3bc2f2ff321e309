"""Solids out of the collision geometry of a URDF link, and the fields that grow around them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from mobee.robot.robot import Array, Shape
from mobee.robot.urdf.bounding import smallest, smallest_capsule
from mobee.robot.urdf.frames import Frame, child, read_origin, triple
from mobee.robot.urdf.hull import convex_hull
from mobee.robot.urdf.mesh import read_mesh
from mobee.robot.urdf.mesh_path import find_mesh
from mobee.robot.xml_node import SMALLEST, Node, nearest

Meshes = Literal["hull", "bounding"]
GEOMETRIES = ("sphere", "cylinder", "capsule", "box", "mesh")
LINK_TAGS = ("inertial", "visual", "collision", "contact", "mobee")
LARGEST = 1e4  # m
CLOSE = 1e-9  # m, for the ends of a cylinder that carries two spheres as caps


@dataclass(slots=True, eq=False)
class ShapeReader:
    """Reads the shapes of one robot; each mesh file is opened once."""

    meshes: Meshes
    known: dict[tuple[Path, tuple[float, ...]], Array]

    def read(self, link: Node, index: int, frame: Frame, part: str) -> list[tuple[Node, Shape]]:
        """The solids of a <link>, and the fields that `write_urdf` noted; `frame`: the link's at zero pose, root frame."""
        name = link.text("name")
        found: list[tuple[Node, Shape]] = []
        for node in link:
            if node.tag not in LINK_TAGS and nearest(node.tag, LINK_TAGS):
                node.warn(f"unknown tag is ignored. {nearest(node.tag, LINK_TAGS)}")
            noted = node.tag == "mobee" and "field" in node.attributes
            if node.tag != "collision" and not noted:
                continue
            place = frame @ read_origin(node)
            called = node.text("field") if noted else node.optional("name") or name
            shape = Shape(called, index, "sphere", (), place.position, place.rotation, "field" if noted else "solid", part)
            found.append((node, self._shaped(node, shape)))
        return _capsules(found)

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
        scale = triple(form, "scale") if "scale" in form.attributes else np.ones(3)
        if np.abs(scale).min() < SMALLEST:
            form.fail("scale", "has a factor of 0", "Write three factors such as 0.001 0.001 0.001")
        key = (find_mesh(form), tuple(scale.tolist()))
        if key not in self.known:
            points = read_mesh(key[0]) * scale
            if not LARGEST >= float(np.ptp(points, axis=0).max()) >= SMALLEST:
                extent = float(np.ptp(points, axis=0).max())
                form.fail("scale", f"the mesh is {extent:g} m long", "Correct the scale: URDF counts in metres")
            self.known[key] = convex_hull(points)
        vertices = self.known[key]
        frame = Frame(shape.position, shape.rotation)
        if self.meshes == "bounding":
            fit = smallest(vertices)
            place = frame @ Frame(fit.centre, fit.rotation)
            return replace(shape, kind=fit.kind, size=fit.size, position=place.position, rotation=place.rotation)
        centre = (vertices.min(axis=0) + vertices.max(axis=0)) / 2.0
        place = frame @ Frame(centre, np.eye(3))
        return replace(shape, kind="convex", position=place.position, vertices=vertices - centre)


def _length(form: Node, name: str) -> float:
    value = form.positive(name)
    if value > LARGEST:
        form.fail(name, f"{value:g} m is too long", "URDF counts in metres")
    return value


def _capsules(found: list[tuple[Node, Shape]]) -> list[tuple[Node, Shape]]:
    """URDF has no capsule of its own, so a cylinder with a sphere of its radius at either end is one."""
    spheres = [(k, shape) for k, (_, shape) in enumerate(found) if shape.kind == "sphere"]
    caps: set[int] = set()
    merged = []
    for node, shape in found:
        if shape.kind == "cylinder":
            radius, height = shape.size
            ends = [shape.position + side * height / 2.0 * shape.rotation[:, 2] for side in (1.0, -1.0)]
            at_ends = [[k for k, s in spheres if s.role == shape.role and _is_cap(s, radius, end)] for end in ends]
            if all(at_ends):
                caps |= {at_ends[0][0], at_ends[1][0]}
                shape = replace(shape, kind="capsule")
        merged.append((node, shape))
    return [entry for k, entry in enumerate(merged) if k not in caps]


def _is_cap(sphere: Shape, radius: float, end: Array) -> bool:
    return abs(sphere.size[0] - radius) < CLOSE and float(np.abs(sphere.position - end).max()) < CLOSE


def grown(shape: Shape, by: float, name: str) -> Shape:
    """The field around a solid that reaches `by` [m] farther; around a mesh it is a capsule."""
    field = replace(shape, name=name, role="field")
    match shape.kind:
        case "sphere" | "capsule":
            return replace(field, size=(shape.size[0] + by, *shape.size[1:]))
        case "cylinder":
            return replace(field, size=(shape.size[0] + by, shape.size[1] + 2 * by))
        case "box":
            return replace(field, size=tuple(edge + 2 * by for edge in shape.size))
    vertices = shape.vertices
    if vertices is None:
        raise ValueError(f"the convex shape {shape.name!r} has no vertices")
    fit = smallest_capsule(vertices)
    place = Frame(shape.position, shape.rotation) @ Frame(fit.centre, fit.rotation)
    size = (fit.size[0] + by, fit.size[1])
    return replace(field, kind="capsule", size=size, position=place.position, rotation=place.rotation, vertices=None)
