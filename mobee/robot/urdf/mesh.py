# SPDX-License-Identifier: Apache-2.0
"""Finds mesh files, and reads the points of those in STL, OBJ and COLLADA.

The points of a COLLADA file are placed as in its scene. Their lengths are converted to metres by the file's <unit>. Its <up_axis> is
ignored, as by ROS tools: the URDF gives the orientation.
"""

from __future__ import annotations

import os
import re
import stat
import sysconfig
import xml.sax.xmlreader
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from urllib.parse import unquote, urlsplit

import numpy as np

from mobee.arrays import Array, Ints
from mobee.errors import RobotFileError
from mobee.robot.robot import MeshSource
from mobee.robot.xml.file import LineHandler, is_file, parse_xml
from mobee.robot.xml.node import Node
from mobee.robot.xml.volume import turn_about

PACKAGES = ("package", "model")
REMEDY = "Put the package's folder beside or above the URDF, or name where it lies in ROS_PACKAGE_PATH"
LARGEST = 50_000_000  # bytes
FARTHEST = 1e6  # m
STL_HEADER, STL_FACET = 84, 50  # bytes of a binary STL: header and count, then each facet
FACETS = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)
OBJ_VERTICES = re.compile(rb"^[ \t]*v[ \t]+(\S+)[ \t]+(\S+)[ \t]+(\S+)", re.MULTILINE)
OBJ_FACES = re.compile(rb"^[ \t]*f[ \t]+([^\r\n]+)", re.MULTILINE)
DEEPEST = 100  # elements inside each other in a COLLADA file
MOST_ELEMENTS = 50_000  # of a COLLADA file
MOST_POINTS = 2_000_000  # of a COLLADA scene, which may place one geometry many times
TRANSFORMS = ("matrix", "translate", "rotate", "scale")
TEXTS = ("float_array", "p", *TRANSFORMS)  # elements whose text is needed
FACES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def find_mesh(node: Node) -> Path:
    """Return the path of the existing file that a <mesh filename="..."> element names.

    Raises RobotFileError, with the searched paths, if there is no such file.
    """
    given = node.text("filename")
    if "\0" in given:
        node.fail("filename", "holds a zero byte", "Write a path")
    candidates = mesh_places(given, node.file)
    if not candidates:
        node.fail("filename", f"{given!r} cannot be followed", "Write package://, file:// or a path")
    found = first_file(candidates)
    if found is None:
        scheme = given.partition("://")[0].lower() if "://" in given else ""
        remedy = REMEDY if scheme in PACKAGES else "Correct the path" if scheme else "Give a path that starts at the URDF's folder"
        node.fail("filename", f"no mesh {given!r} (looked at {searched(candidates)})", remedy)
    return found


def mesh_places(given: str, robot_file: Path) -> list[Path]:
    """Return the paths that the name `given` of a mesh in a robot's file can mean, in the order of the search; empty for an unknown scheme.

    `package://name/...` is searched from the robot's folder upwards, then in ROS_PACKAGE_PATH and AMENT_PREFIX_PATH, then in the folder in
    which pip installs data; a plain path and `file://` start at the robot's folder.
    """
    try:
        scheme, rest = urlsplit(given).scheme.lower(), given.partition("://")[2]
    except ValueError:  # brackets of an IPv6 address that is none
        scheme, rest = "?", ""
    if "://" not in given:
        return [robot_file.parent / given]
    if scheme == "file":
        return [robot_file.parent / unquote(rest)]
    if scheme in PACKAGES:
        package, _, inner = rest.partition("/")
        return list(_in_packages(robot_file, package, inner))
    return []


def mesh_name(mesh: MeshSource, path: Path) -> str:
    """Return the name by which a robot file at `path` must name a mesh.

    It is the path of the mesh's file relative to the folder of `path`. In two cases the present name is kept: if no file is found for it,
    and if it is a package:// address that leads to a file also when it is searched from `path`.
    """
    found = first_file(mesh_places(mesh.file, mesh.robot_file))
    same = first_file(mesh_places(mesh.file, path)) if mesh.file.partition("://")[0].lower() in PACKAGES else None
    if found is None or same is not None:
        return mesh.file
    try:
        return Path(os.path.relpath(found.resolve(), path.resolve().parent)).as_posix()
    except ValueError:  # on another drive
        return found.resolve().as_posix()


def first_file(candidates: list[Path]) -> Path | None:
    """Return the first of the `candidates` that is an existing file; None if there is none."""
    return next((path for path in candidates if is_file(path)), None)


def searched(candidates: list[Path]) -> str:
    """Return the searched paths as text for a message, at most six of them."""
    more = f" and {len(candidates) - 6} more" if len(candidates) > 6 else ""
    return ", ".join(str(path) for path in candidates[:6]) + more


def _in_packages(robot_file: Path, package: str, inner: str) -> Iterator[Path]:
    for folder in robot_file.resolve().parents:
        yield folder / package / inner
        if folder.name == package:
            yield folder / inner
    for entry in filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)):
        yield Path(entry) / package / inner
        if Path(entry).name == package:
            yield Path(entry) / inner
    for entry in filter(None, os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)):
        yield Path(entry) / "share" / package / inner
    for scheme in dict.fromkeys((sysconfig.get_default_scheme(), sysconfig.get_preferred_scheme("user"))):
        yield Path(sysconfig.get_path("data", scheme)) / "share" / package / inner  # of wheels, as icub-models


def read_mesh(path: Path) -> Array:
    """Return the points (v, 3) of a .stl, .obj or .dae file, each once, in the units of the file (.dae: in m).

    The points are the corners of the faces of the mesh; for a file without faces, all its points.
    Raises RobotFileError, with the remedy, for a file that cannot be read, is no mesh, or holds no points.
    """
    kind = path.suffix.lower()
    if kind not in READERS:
        raise RobotFileError(f"{path}: meshes of type {kind or 'unknown'!r} cannot be read. Convert it to .stl, .obj or .dae.")
    points = READERS[kind](path)
    if not len(points):
        raise RobotFileError(f"{path}: holds no points. Export the mesh again, or remove it from the robot.")
    if not np.isfinite(points).all() or float(np.abs(points).max()) > FARTHEST:
        raise RobotFileError(f"{path}: has points that are not finite or farther than {FARTHEST:g} m away. Export the mesh again.")
    points = points[np.lexsort(points.T[::-1])]  # np.unique takes three times as long
    once: Array = points[np.append(True, (points[1:] != points[:-1]).any(axis=1))]
    return once


def _stl(path: Path) -> Array:
    content = _content(path)
    facets = int.from_bytes(content[80:STL_HEADER], "little")
    body = len(content) - STL_HEADER
    if body == STL_FACET * facets:
        return _stl_facets(content, facets)
    if content.lstrip()[:5].lower() == b"solid":
        return _numbers(path, FACETS.findall(content), content.lower().count(b"vertex"))
    if 0 < STL_FACET * facets < body:  # some programs add data behind the facets
        return _stl_facets(content, facets)
    what = f"announces {facets} facets and has room for {max(body, 0) // STL_FACET}" if body >= 0 else "is too short"
    raise RobotFileError(f"{path}: not a complete STL file: it {what}. Export the mesh again.")


def _stl_facets(content: bytes, facets: int) -> Array:
    layout = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table = np.frombuffer(content, layout, count=facets, offset=STL_HEADER)
    points: Array = table["corners"].reshape(-1, 3).astype(np.float64)
    return points


def _obj(path: Path) -> Array:
    content = _content(path).replace(b"\\\n", b" ")  # a backslash continues a line
    points = _numbers(path, OBJ_VERTICES.findall(content), len(re.findall(rb"^[ \t]*v[ \t]", content, re.MULTILINE)))
    corners = _obj_corners(path, content)
    if not len(corners) or corners[0] < 0:  # indices relative to the end: rare; all points are used, whose hull is no smaller
        return points
    if corners[0] == 0 or corners[-1] > len(points):
        raise RobotFileError(f"{path}: a face names a vertex beyond the {len(points)} that there are. Export the mesh again.")
    return points[corners - 1]


def _obj_corners(path: Path, content: bytes) -> Ints:
    """Return the indices of the vertices that belong to a face, sorted; the others are not part of the surface."""
    named = b" ".join(OBJ_FACES.findall(content)).split()
    try:
        return np.unique(np.array([word.partition(b"/")[0] for word in named], dtype=np.bytes_).astype(np.intp))
    except ValueError as error:
        raise RobotFileError(f"{path}: a face is no list of vertices ({error}). Export the mesh again.") from error


def _numbers(path: Path, words: list[tuple[bytes, bytes, bytes]], vertices: int) -> Array:
    if len(words) != vertices:
        raise RobotFileError(f"{path}: {vertices - len(words)} of {vertices} vertices lack a coordinate. Export the mesh again.")
    try:
        points: Array = np.array(words, dtype=np.bytes_).reshape(-1, 3).astype(np.float64)
    except ValueError as error:
        raise RobotFileError(f"{path}: a coordinate is no number ({error}). Export the mesh again.") from error
    return points


def _content(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise RobotFileError(f"{path}: is not a regular file. Give the path of a mesh.")
        with path.open("rb") as file:
            content = file.read(LARGEST + 1)
    except OSError as error:
        raise RobotFileError(f"{path}: cannot be read ({error.strerror}). Check the path and its permissions.") from error
    if len(content) > LARGEST:
        raise RobotFileError(f"{path}: the mesh is larger than {LARGEST // 1_000_000} MB. Simplify it: only its hull is used.")
    return content


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
    """Return the points (v, 3) m of all geometries in the scene of a COLLADA file, in the frame of the scene.

    If the scene places no geometry, all geometries of the file are taken. Raises RobotFileError if the file is missing, not valid or too
    large.
    """
    builder = _Builder(path)
    parse_xml(path, builder)
    root = builder.root
    units = root.all("unit")
    meter = float(_dae_numbers(path, units[0], units[0].attributes.get("meter", "1"), 1)[0]) if units else 1.0
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
            points = _dae_numbers(path, array, array.text, 3).reshape(-1, 3)
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
                    numbers = _dae_numbers(path, listed, listed.text, max(offsets) + 1)
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
        return _dae_numbers(path, element, element.text, 16)[:16].reshape(4, 4)
    frame = np.eye(4)
    if element.tag == "rotate":
        x, y, z, degrees = _dae_numbers(path, element, element.text, 4)[:4]
        length = float(np.linalg.norm([x, y, z]))
        if length < 1e-9:
            _fail(path, element, "the axis has no length", "Export the mesh again")
        frame[:3, :3] = turn_about(np.array([x, y, z]) / length, float(np.deg2rad(degrees)))
        return frame
    values = _dae_numbers(path, element, element.text, 3)[:3]
    if element.tag == "translate":
        frame[:3, 3] = values
    else:
        frame[:3, :3] = np.diag(values)
    return frame


def _dae_numbers(path: Path, element: _Element, text: str, group: int) -> Array:
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


READERS = {".stl": _stl, ".obj": _obj, ".dae": read_dae}
