# SPDX-License-Identifier: Apache-2.0
"""Reads the points of COLLADA files, placed as in their scene.

Lengths are converted to metres by the file's <unit>. Its <up_axis> is ignored, as by ROS tools: the URDF gives the orientation.
"""

from __future__ import annotations

import xml.sax.xmlreader
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import RobotFileError
from mobee.robot.xml.file import LineHandler, parse_xml
from mobee.robot.xml.volume import turn_about

DEEPEST = 100
MOST_ELEMENTS = 50_000
MOST_POINTS = 2_000_000  # a scene may place one geometry many times
TRANSFORMS = ("matrix", "translate", "rotate", "scale")
TEXTS = ("float_array", "p", *TRANSFORMS)  # elements whose text is needed
FACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


@dataclass(slots=True, eq=False)
class _Element:
    tag: str
    line: int
    attributes: dict[str, str]
    children: list[_Element] = field(default_factory=list)
    text: str = ""

    def all(self, tag: str) -> list[_Element]:
        """Return every element of a tag below this one."""
        found, stack = [], list(reversed(self.children))
        while stack:
            element = stack.pop()
            if element.tag == tag:
                found.append(element)
            stack += reversed(element.children)
        return found


class _Builder(LineHandler):
    def __init__(self, path: Path) -> None:
        super().__init__()
        self.path = path
        self.root = _Element("", 0, {})
        self.open = [self.root]
        self.count = 0
        self.words: list[str] = []

    def startElement(self, name: str, attrs: xml.sax.xmlreader.AttributesImpl) -> None:
        element = _Element(name.lower(), self.line, dict(attrs.items()))
        self.count += 1
        if len(self.open) > DEEPEST or self.count > MOST_ELEMENTS:
            _fail(self.path, element, f"more than {DEEPEST} elements deep or {MOST_ELEMENTS} in all", "Simplify the mesh")
        self.open[-1].children.append(element)
        self.open.append(element)
        self.words = []

    def characters(self, content: str) -> None:
        if self.open[-1].tag in TEXTS:
            self.words.append(content)

    def endElement(self, name: str) -> None:
        self.open.pop().text = "".join(self.words)
        self.words = []


def read_dae(path: Path) -> Array:
    """Return the points (v, 3) m of all geometries in the scene of a COLLADA file, in the frame of the scene; raises RobotFileError.

    If the scene places no geometry, all geometries of the file are taken.
    """
    builder = _Builder(path)
    parse_xml(path, builder)
    root = builder.root
    units = root.all("unit")
    meter = float(_numbers(path, units[0], units[0].attributes.get("meter", "1"), 1)[0]) if units else 1.0
    geometries = {geometry.attributes.get("id", ""): _points(path, geometry) for geometry in root.all("geometry")}
    return meter * np.vstack([np.empty((0, 3)), *(_placed(path, root, geometries) or geometries.values())])


def _points(path: Path, geometry: _Element) -> Array:
    """Return the corners of a geometry's faces, since several geometries may share one array of points; all points if it has no faces."""
    sources = {source.attributes.get("id", ""): source for source in geometry.all("source")}
    arrays = []
    for vertices in geometry.all("vertices"):
        corners = _corners(path, geometry, vertices.attributes.get("id", ""))
        for given in vertices.all("input"):
            if given.attributes.get("semantic") != "POSITION":
                continue
            name = given.attributes.get("source", "").removeprefix("#")
            if name not in sources or not sources[name].all("float_array"):
                _fail(path, geometry, f"its positions {name!r} are missing", "Export the mesh again")
            array = sources[name].all("float_array")[0]
            points = _numbers(path, array, array.text, 3).reshape(-1, 3)
            if len(corners) and not 0 <= corners.min() <= corners.max() < len(points):
                _fail(path, geometry, f"a face names a point beyond the {len(points)} of {name!r}", "Export the mesh again")
            arrays.append(points[corners] if len(corners) else points)
    return np.vstack([np.empty((0, 3)), *arrays])


def _corners(path: Path, geometry: _Element, vertices: str) -> Ints:
    """Return the indices of the points that the faces of a geometry use; `vertices`: the id of its element <vertices>."""
    found = [np.empty(0, dtype=np.intp)]
    for faces in (element for tag in FACES for element in geometry.all(tag)):
        inputs = [element for element in faces.children if element.tag == "input"]
        offsets = [_offset(path, element) for element in inputs]
        for given, offset in zip(inputs, offsets, strict=True):
            if given.attributes.get("semantic") != "VERTEX" or given.attributes.get("source", "").removeprefix("#") != vertices:
                continue
            for listed in faces.all("p"):
                if listed.text.strip():
                    numbers = _numbers(path, listed, listed.text, max(offsets) + 1)
                    found.append(numbers[offset :: max(offsets) + 1].astype(np.intp))
    return np.unique(np.concatenate(found))


def _offset(path: Path, given: _Element) -> int:
    text = given.attributes.get("offset", "0").strip()
    if not (text.isascii() and text.isdecimal() and len(text) < 4):
        _fail(path, given, f"offset {text[:20]!r} is not a whole number", "Export the mesh again")
    return int(text)


def _placed(path: Path, root: _Element, shapes: dict[str, Array]) -> list[Array]:
    """Return the points of all geometries of the scene, each transformed by its nodes."""
    nodes = {node.attributes.get("id", ""): node for node in root.all("node")}
    stack = [(scene, np.eye(4)) for scene in root.all("visual_scene")]
    placed: list[Array] = []
    visits = points = 0
    while stack:
        node, frame = stack.pop()
        for child in node.children:
            name = child.attributes.get("url", "").removeprefix("#")
            if child.tag in TRANSFORMS:
                frame = frame @ _transform(path, child)
            elif child.tag == "node":
                stack.append((child, frame))
            elif child.tag == "instance_node" and name in nodes:
                stack.append((nodes[name], frame))
            elif child.tag == "instance_geometry" and name in shapes:
                placed.append(shapes[name] @ frame[:3, :3].T + frame[:3, 3])
                points += len(shapes[name])
            visits += 1
            if visits > MOST_ELEMENTS or points > MOST_POINTS:  # nodes may place each other, even without end
                _fail(path, child, f"the scene holds more than {MOST_ELEMENTS} nodes or {MOST_POINTS} points", "Simplify the mesh")
    return placed


def _transform(path: Path, element: _Element) -> Array:
    if element.tag == "matrix":
        return _numbers(path, element, element.text, 16)[:16].reshape(4, 4)
    frame = np.eye(4)
    if element.tag == "rotate":
        x, y, z, degrees = _numbers(path, element, element.text, 4)[:4]
        length = float(np.linalg.norm([x, y, z]))
        if length < 1e-9:
            _fail(path, element, "the axis has no length", "Export the mesh again")
        frame[:3, :3] = turn_about(np.array([x, y, z]) / length, float(np.deg2rad(degrees)))
        return frame
    values = _numbers(path, element, element.text, 3)[:3]
    if element.tag == "translate":
        frame[:3, 3] = values
    else:
        frame[:3, :3] = np.diag(values)
    return frame


def _numbers(path: Path, element: _Element, text: str, group: int) -> Array:
    """Return the numbers in a text; raises RobotFileError unless all are finite and their count is a multiple of `group`."""
    try:
        values = np.array(text.split(), dtype=np.float64)
    except ValueError as error:
        _fail(path, element, f"holds no number ({error})", "Export the mesh again")
    if not len(values) or len(values) % group or not np.isfinite(values).all() or float(np.abs(values).max()) > 1e9:
        _fail(path, element, f"holds {len(values)} numbers, not a multiple of {group} finite ones", "Export the mesh again")
    return values


def _fail(path: Path, element: _Element, problem: str, remedy: str) -> NoReturn:
    raise RobotFileError(f"{path}:{element.line}: <{element.tag}>: {problem}. {remedy}.")
