# SPDX-License-Identifier: Apache-2.0
"""Writes a robot as URDF for other programs, with an SRDF beside it, and adds disabled pairs to an existing SRDF.

The SRDF has groups, home and disabled pairs.
"""

from __future__ import annotations

import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree as ET
from xml.sax.saxutils import quoteattr

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue, RobotFileError
from mobee.robot.bodies import ball_of_water, to_six
from mobee.robot.robot import Body, Marker, Motor, Robot, Shape
from mobee.robot.urdf.hull import facets
from mobee.robot.urdf.layout import SIX
from mobee.robot.urdf.pairs import adjacent_links
from mobee.robot.urdf.tree import rpy_of
from mobee.robot.writing import drives_of, number, numbers, write_whole
from mobee.robot.xml.node import Node, read_xml
from mobee.robot.xml.pairs import role_elements

NamePair = frozenset[str]
_END = re.compile(rb"[ \t]*</robot\s*>")


@dataclass(slots=True)
class GeometryWriter:
    """Writes the shapes of one robot as URDF elements: solids (volumes of its body) and fields (volumes that cause repulsive forces).

    `folder`: for the files of meshes; it is created for the first mesh. `written`: number of meshes that were written.
    """

    folder: Path
    written: int = 0

    def solid(self, link: ET.Element, shape: Shape, point: Array, note: dict[str, str]) -> None:
        """Add a solid to the element `link`; a capsule is written as a cylinder and two spheres.

        `point`: (3,) m, origin of the link's frame in the root frame. `note`: attributes that URDF does not have; they are written in an
        element <mobee>, if there are any: "part", the name of the shape's part, and "base", "true" if the shape is never tested against
        world objects, else "false"; "capsule", "false" if spheres at its ends make no capsule of a cylinder.
        """
        for name, part in _parts(shape):
            geometry = self._geometry(part)
            for tag in ("visual", "collision"):
                element = ET.SubElement(link, tag, name=name)
                _origin(element, part, point)
                element.append(geometry)
            if note:
                ET.SubElement(element, "mobee", note)

    def field(self, link: ET.Element, shape: Shape, point: Array, note: dict[str, str]) -> None:
        """Add a field to the element `link`, as an element <mobee>, because URDF has no element for fields.

        A field is a volume that causes a repulsive force. `point`: (3,) m, origin of the link's frame in the root frame. `note`: further
        attributes of the element <mobee>, "part" and "base" as in `solid`.
        """
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
        """Write the hull as an OBJ, which other programs read and which keeps all digits; return its path relative to the URDF's folder."""
        if shape.vertices is None:
            raise InvalidValue(f"the convex shape {shape.name!r} has no vertices.")
        self.folder.mkdir(exist_ok=True)
        name = f"{re.sub(r'[^A-Za-z0-9_]', '_', shape.name)[:60]}_{self.written}.obj"
        self.written += 1
        triangles = facets(shape.vertices)
        lines = [f"v {numbers(corner)}" for corner in triangles.reshape(-1, 3)]
        lines += [f"f {first} {first + 1} {first + 2}" for first in range(1, 3 * len(triangles), 3)]
        (self.folder / name).write_text("\n".join([*lines, ""]), encoding="ascii")
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


Master = tuple[int, float, float]  # joint, scale, offset


def write_urdf(robot: Robot, path: str | Path) -> Path:
    """Write a robot to a URDF file x.urdf and return its path; beside it, write x.srdf and, for convex shapes, the folder x_meshes.

    Every link's frame is at its joint, with the orientation of the root frame at zero pose. One joint represents each motor: the first one
    whose position equals the motor's, else the motor's first joint; the motor's other joints mimic it. Markers are links on fixed joints.
    `load_robot` reads the file as the same robot with these differences: it has no clauses (conditions on several motor positions) and no
    cameras; `Robot.least_lever`, which scales the forces of fields, is 0; the visuals are the solids; `Motor.zone_ends_at_home`, which ends
    a limit zone at home, is True for all motors; a convex shape with more than 64 corners is replaced by an enclosing hull with at most 64.
    Raises InvalidValue if a joint has no motor, or if several motors drive it.
    """
    path = Path(path)
    drives_of(robot)  # raises for a joint without a master
    masters = tuple(_master(motor) for motor in robot.motor_table)
    part_of = ["", *(robot.motor_table[drive.motor].part for drive in drives_of(robot))]
    root = ET.Element("robot", name=robot.name)
    root.append(ET.Comment(_comment(robot)))
    writer = GeometryWriter(path.with_name(f"{path.stem}_meshes"))
    points = [np.zeros(3), *(joint.point for joint in robot.joints)]
    for index, name in enumerate(robot.links):
        _write_body(robot, ET.SubElement(root, "link", name=name), index, points[index], part_of[index] or part_of[1], writer)
    for motor, master in zip(robot.motor_table, masters, strict=True):
        for joint, scale, offset in motor.joints:
            _write_joint(robot, root, motor, master, (joint, scale, offset), points)
    _write_markers(robot, root, points)
    _write_pairs(robot, root)
    ET.indent(root, " ")
    write_whole(path, ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
    write_srdf(robot, masters, path.with_suffix(".srdf"))
    return path


def _master(motor: Motor) -> Master:
    """Return the joint that represents a motor: one that moves as the motor does, else the first."""
    return next((drive for drive in motor.joints if drive[1:] == (1.0, 0.0)), motor.joints[0])


def _comment(robot: Robot) -> str:
    lines = ["Written by mobee convert."]
    if not robot.bodies:
        lines.append("It holds no masses.")
    elif any(body.inertia is None for body in robot.bodies):
        lines.append('Where <mobee assumed="true"/> stands only the mass is known; the moments of inertia are those of a ball of water.')
    if robot.clauses:
        lines.append("Not in this file: at least one row of every clause holds, a.q + b > 0 in rad and m.")
    for index, clause in enumerate(robot.clauses):
        rows = []
        for row, offset in zip(clause.a, clause.b, strict=True):
            terms = [f"{number(row[k])} {robot.motors[k]}" for k in np.flatnonzero(row)]
            rows.append(f"{' + '.join(terms)} + {number(offset)} > 0")
        lines.append(f"clause {index}, {clause.part}: {' or '.join(rows)}")
    return "\n".join(["", *lines, ""]).replace("--", "- -")


def _write_body(robot: Robot, link: ET.Element, index: int, point: Array, part: str, writer: GeometryWriter) -> None:
    link.extend(inertial_element(body, point) for body in robot.bodies if body.link == index)
    balls = {(shape.link, shape.size[0]) for shape in robot.shapes if shape.kind in ("sphere", "capsule")}
    for k, shape in enumerate(robot.shapes):
        if shape.link != index:
            continue
        note = {} if shape.part == part else {"part": shape.part}
        if (k in robot.base_shapes) != (index == 0):
            note["base"] = "true" if index else "false"
        if shape.kind == "cylinder" and shape.role == "solid" and (index, shape.size[0]) in balls:
            note["capsule"] = "false"
        write = writer.field if shape.role == "field" else writer.solid
        write(link, shape, point, note)


def _write_joint(robot: Robot, root: ET.Element, motor: Motor, master: Master, drive: Master, points: list[Array]) -> None:
    index, scale, offset = drive
    joint = robot.joints[index]
    element = ET.SubElement(root, "joint", name=joint.name, type=joint.kind)
    ET.SubElement(element, "origin", xyz=numbers(joint.point - points[joint.parent]), rpy="0 0 0")
    ET.SubElement(element, "parent", link=robot.links[joint.parent])
    ET.SubElement(element, "child", link=robot.links[index + 1])
    ET.SubElement(element, "axis", xyz=numbers(joint.axis))
    low, high = np.sort(scale * motor.limits + offset)
    speed, effort = motor.max_velocity * abs(scale), motor.max_torque / abs(scale)
    ET.SubElement(element, "limit", lower=number(low), upper=number(high), velocity=number(speed), effort=number(effort))
    if index != master[0]:
        factor = scale / master[1]
        shift = number(offset - factor * master[2])
        ET.SubElement(element, "mimic", joint=robot.joints[master[0]].name, multiplier=number(factor), offset=shift)
        return
    note = {} if motor.name == joint.name else {"motor": motor.name}
    note |= {} if (scale, offset) == (1.0, 0.0) else {"scale": number(scale), "offset": number(offset)}
    ET.SubElement(element, "mobee", note | {"acceleration": number(motor.max_acceleration)})


def _write_markers(robot: Robot, root: ET.Element, points: list[Array]) -> None:
    links = set(robot.links)
    joints = {joint.name for joint in robot.joints}
    for marker in robot.markers.values():
        name = _free(marker.name, links)
        link = ET.SubElement(root, "link", name=name)
        ET.SubElement(link, "mobee", {"marker": marker.name} | _normal(marker))
        joint = ET.SubElement(root, "joint", name=_free(f"{name}_fixed", joints), type="fixed")
        ET.SubElement(joint, "origin", xyz=numbers(marker.position - points[marker.link]), rpy=numbers(rpy_of(marker.rotation)))
        ET.SubElement(joint, "parent", link=robot.links[marker.link])
        ET.SubElement(joint, "child", link=name)


def _normal(marker: Marker) -> dict[str, str]:
    normal = marker.rotation.T @ marker.normal
    return {} if abs(normal[2] - 1.0) < 1e-15 else {"normal": numbers(normal)}


def _free(name: str, taken: set[str]) -> str:
    """Return the name, changed if it is taken, and mark it as taken."""
    while name in taken:
        name += "_marker"
    taken.add(name)
    return name


def _write_pairs(robot: Robot, root: ET.Element) -> None:
    own = any(robot.shapes[a].part == robot.shapes[b].part for a, b in robot.field_pairs.tolist())
    rest = [
        element
        for role, pairs in (("solid", robot.solid_pairs), ("field", robot.field_pairs))
        for element in role_elements(robot, role, pairs, own)
    ]
    if rest or own:
        ET.SubElement(root, "mobee", {"ownFields": "true"} if own else {}).extend(rest)


def inertial_element(body: Body, point: Array) -> ET.Element:
    """Return the <inertial> element of a link whose frame is at `point` (3,) m in the root frame, without rotation.

    URDF requires moments of inertia: a body without them gets those of a ball of water of its mass, and the element is marked as assumed.
    """
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=numbers(body.centre - point), rpy="0 0 0")
    ET.SubElement(element, "mass", value=number(body.mass))
    inertia = ball_of_water(body.mass) if body.inertia is None else np.asarray(body.inertia)
    ET.SubElement(element, "inertia", dict(zip(SIX, map(number, to_six(inertia)), strict=True)))
    if body.inertia is None:
        ET.SubElement(element, "mobee", assumed="true")
    return element


def write_srdf(robot: Robot, masters: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Write an SRDF file with the robot's parts as groups, its home pose, and its disabled and enabled pairs of links.

    `masters`: for each motor (index of the joint that represents it in the URDF, scale, offset), with joint = scale * motor + offset.
    """
    root = ET.Element("robot", name=robot.name)
    for part in robot.parts.values():
        group = ET.SubElement(root, "group", name=part.name)
        for joint, _, _ in masters[part.slice]:
            ET.SubElement(group, "joint", name=robot.joints[joint].name)
    for part in robot.parts.values():
        state = ET.SubElement(root, "group_state", name="home", group=part.name)
        for motor, (joint, scale, offset) in zip(robot.motor_table[part.slice], masters[part.slice], strict=True):
            ET.SubElement(state, "joint", name=robot.joints[joint].name, value=number(scale * motor.home + offset))
    for pair, reason in robot.untested.items():
        first, second = (robot.links[index] for index in sorted(pair))
        ET.SubElement(root, "disable_collisions", link1=first, link2=second, reason=reason)
    for pair in adjacent_links(robot.joints, robot.shapes):
        if pair not in robot.untested:
            first, second = (robot.links[index] for index in sorted(pair))
            ET.SubElement(root, "enable_collisions", link1=first, link2=second)
    ET.indent(root, " ")
    write_whole(path, ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")


def write_disabled(path: Path, base: Path | None, name: str, pairs: Iterable[tuple[str, str, str]]) -> None:
    """Write an SRDF file with <disable_collisions> for `pairs` of links, each (link1, link2, reason).

    `base`: an existing SRDF whose text is kept word for word, with the new lines before its end; None: a new file for the robot `name`.
    Raises RobotFileError if lines cannot be added to that text, or if the file cannot be written; an existing file is then unchanged.
    """
    lines = [f"<disable_collisions link1={quoteattr(a)} link2={quoteattr(b)} reason={quoteattr(why)}/>" for a, b, why in pairs]
    text = _merged(base, lines) if base is not None else _begun(name, lines)
    target = path.resolve()
    try:
        with tempfile.NamedTemporaryFile(dir=target.parent, prefix=".", suffix=".srdf", delete=False) as file:
            unfinished = Path(file.name)
            file.write(text)
        try:
            if target.exists():
                shutil.copymode(target, unfinished)
            else:
                unfinished.chmod(0o666 & ~_umask())
            if base is not None:
                _check(unfinished, base, lines)
            unfinished.replace(target)
        finally:
            unfinished.unlink(missing_ok=True)
    except OSError as error:
        raise RobotFileError(f"{path}: cannot be written: {error.strerror or error}. Name another file: --write-srdf FILE.") from None


def disabled_and_enabled(path: Path) -> tuple[set[NamePair], set[NamePair]]:
    """Return the pairs of links in <disable_collisions>, and those in <enable_collisions>, of an SRDF file, as pairs of link names.

    Raises RobotFileError if the file cannot be read.
    """
    root = read_xml(path)
    return _pairs(root, "disable_collisions"), _pairs(root, "enable_collisions")


def _pairs(root: Node, tag: str) -> set[NamePair]:
    return {frozenset((node.optional("link1") or "", node.optional("link2") or "")) for node in root if node.tag == tag}


def _begun(name: str, lines: list[str]) -> bytes:
    return "\n".join(
        ['<?xml version="1.0" encoding="utf-8"?>', f"<robot name={quoteattr(name)}>", *(f" {line}" for line in lines), "</robot>", ""]
    ).encode()


def _merged(base: Path, lines: list[str]) -> bytes:
    """Return the text with lines inserted before its last </robot>."""
    text = base.read_bytes()
    ends = list(_END.finditer(text))
    if not ends:
        raise RobotFileError(f"{base}: has no </robot> before which lines can be put. Write <robot name=...></robot>, in UTF-8.")
    end = ends[-1]
    newline = b"\r\n" if b"\r\n" in text else b"\n"
    added = b"".join(b" " + line.encode("ascii", "xmlcharrefreplace") + newline for line in lines)
    before = text[: end.start()]
    if before and not before.endswith(b"\n"):
        before += newline
    return before + added + text[end.start() :]


def _check(unfinished: Path, base: Path, lines: list[str]) -> None:
    """Raise RobotFileError unless the new file has the elements of the old one plus the new lines.

    They differ if the last </robot> of the old file is inside a comment.
    """
    before, after = read_xml(base), read_xml(unfinished)
    if [_content(node) for node in after][: len(before.children)] != [_content(node) for node in before] or len(after.children) != len(
        before.children
    ) + len(lines):
        raise RobotFileError(f"{base}: lines cannot be put before its last </robot>. Remove what stands behind that.")


def _content(node: Node) -> tuple[object, ...]:
    return (node.tag, tuple(sorted(node.attributes.items())), tuple(_content(inner) for inner in node))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
