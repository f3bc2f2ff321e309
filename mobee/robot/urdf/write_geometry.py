"""Shapes as URDF draws them: origin, geometry, and a mesh file for a convex one."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from mobee.errors import InvalidValue
from mobee.robot.number_text import number, numbers
from mobee.robot.robot import Array, Shape
from mobee.robot.urdf.frames import rpy_of
from mobee.robot.urdf.hull import facets


@dataclass(slots=True)
class GeometryWriter:
    """Draws shapes of one robot; `folder` is where meshes go, and is made when the first one comes."""

    folder: Path
    written: int = 0

    def solid(self, link: ET.Element, shape: Shape, point: Array, note: dict[str, str]) -> None:
        """Add a solid to a link whose frame stands at `point`; a capsule is drawn as a cylinder with two spheres."""
        for name, part in _parts(shape):
            geometry = self._geometry(part)
            for tag in ("visual", "collision"):
                element = ET.SubElement(link, tag, name=name)
                _origin(element, part, point)
                element.append(geometry)
            if note:
                ET.SubElement(element, "mobee", note)

    def field(self, link: ET.Element, shape: Shape, point: Array, note: dict[str, str]) -> None:
        """Note a field, which URDF has no word for."""
        element = ET.SubElement(link, "mobee", {"field": shape.name} | note)
        _origin(element, shape, point)
        element.append(self._geometry(shape))

    def _geometry(self, shape: Shape) -> ET.Element:
        geometry = ET.Element("geometry")
        match shape.kind:
            case "sphere":
                ET.SubElement(geometry, "sphere", radius=number(shape.size[0]))
            case "capsule" | "cylinder":
                ET.SubElement(geometry, shape.kind, radius=number(shape.size[0]), length=number(shape.size[1]))
            case "box":
                ET.SubElement(geometry, "box", size=numbers(np.array(shape.size)))
            case _:
                ET.SubElement(geometry, "mesh", filename=self._mesh(shape))
        return geometry

    def _mesh(self, shape: Shape) -> str:
        """Write the hull as an STL in text, for a binary one keeps seven digits only; returns its path from the URDF's folder."""
        if shape.vertices is None:
            raise InvalidValue(f"the convex shape {shape.name!r} has no vertices.")
        self.folder.mkdir(exist_ok=True)
        name = f"{re.sub(r'[^A-Za-z0-9_]', '_', shape.name)[:60]}_{self.written}.stl"
        self.written += 1
        lines = ["solid hull"]
        for corners in facets(shape.vertices):
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            lines.append(f"facet normal {numbers(normal / max(float(np.linalg.norm(normal)), 1e-300))}")
            lines.append("outer loop")
            lines += [f"vertex {numbers(corner)}" for corner in corners]
            lines += ["endloop", "endfacet"]
        (self.folder / name).write_text("\n".join([*lines, "endsolid hull", ""]), encoding="ascii")
        return f"{self.folder.name}/{name}"


def _parts(shape: Shape) -> list[tuple[str, Shape]]:
    if shape.kind != "capsule":
        return [(shape.name, shape)]
    radius, height = shape.size
    cylinder = Shape(shape.name, shape.link, "cylinder", shape.size, shape.position, shape.rotation, shape.role, shape.part)
    parts = [(shape.name, cylinder)]
    for side, half in enumerate((height / 2, -height / 2)):
        end = shape.position + half * shape.rotation[:, 2]
        cap = Shape(shape.name, shape.link, "sphere", (radius,), end, np.eye(3), shape.role, shape.part)
        parts.append((f"{shape.name}_cap_{side}", cap))
    return parts


def _origin(element: ET.Element, shape: Shape, point: Array) -> None:
    ET.SubElement(element, "origin", xyz=numbers(shape.position - point), rpy=numbers(rpy_of(shape.rotation)))
