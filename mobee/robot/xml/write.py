# SPDX-License-Identifier: Apache-2.0
"""Writes a robot as zero-position XML (MoBeE's own format for robots, thesis 2.3.1) that reads back as the same robot."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from pathlib import Path
from xml.etree import ElementTree as ET

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.robot.bodies import to_six
from mobee.robot.motor_units import in_metres
from mobee.robot.robot import Body, Clause, Joint, MeshSource, Motor, Robot, Shape
from mobee.robot.urdf.mesh import mesh_name
from mobee.robot.writing import Drive, degrees, drives_of, number, numbers
from mobee.robot.xml.node import DEEPEST, VERSION, Remark, descendants, read_xml, tree_of, write_tree
from mobee.robot.xml.pairs import ignore_elements
from mobee.robot.xml.versions import WORLD_TAGS, upgrade_robot, upgrade_world
from mobee.robot.xml.volume import PLACE, height_and_angle

DIGITS = 1e-14  # m; smaller values are rounding errors of a sum


def write_xml(robot: Robot, path: str | Path) -> Path:
    """Write a robot to a file of zero-position XML (MoBeE's own format, mobee/robot/robots/README.md) and return its path.

    Reading the file gives the same kinematics, motors, parts (groups of motors), shapes, pairs of shapes that are tested for contacts,
    markers, masses, visuals, cameras and clauses (conditions on the positions of motors, `mobee.robot.robot.Clause`). The files of meshes
    are not copied: the new file names them. The order of shapes may differ. The corners of a convex shape are written along the axes of the
    root frame, so its rotation becomes the identity.

    Raises:
        InvalidValue: a joint has no motor or several motors, a shape belongs to an unknown part, a convex shape has no vertices, or the
            tree of links is too deep for a file.
        OSError: the file cannot be written.
    """
    drives = drives_of(robot)
    root = ET.Element("ZeroPositionKinematicTree", version=VERSION, robotName=robot.name, adjacency="listed")
    if robot.least_lever:
        root.set("leastLever", number(robot.least_lever))
    for part in robot.parts.values():
        element = ET.SubElement(root, "bodypart", name=part.name)
        for motor in robot.motor_table[part.slice]:
            element.append(_motor(robot, motor))
        for clause in robot.clauses:
            if clause.part == part.name:
                element.append(_clause(robot, clause))
    base = ET.SubElement(root, "link", name=robot.links[0])
    _write_link(robot, drives, base, 0, np.zeros(3), Path(path))
    root.extend(ignore_elements(robot))
    return write_tree(root, Path(path))


def write_upgraded(source: Path, target: Path) -> list[Remark] | None:
    """Convert a robot or world file from an older version of the format to the present one; return remarks for the user on the changes.

    `source`: the old file. `target`: the file to be written. Comments are left out, and files that `source` includes stay as they are. For
    a robot file in the present version nothing is written, and None is returned. Raises RobotFileError if the file is not valid.
    """
    root = read_xml(source, repair=True)
    if root.tag in WORLD_TAGS:
        remarks = upgrade_world(root)
    elif root.optional("version") == VERSION:
        return None
    else:
        remarks = upgrade_robot(root)
    for node in descendants(root):
        if node.tag == "visual" and node.optional("file"):
            node.attributes["file"] = mesh_name(MeshSource(node.text("file"), source), target)
        elif node.tag == "robot" and (source.parent / node.text("file")).is_file():  # no shipped name
            node.attributes["file"] = Path(os.path.relpath(source.parent / node.text("file"), target.parent)).as_posix()
    write_tree(tree_of(root), target, f"Written by mobee convert from {source.name}.")
    return remarks


def _motor(robot: Robot, motor: Motor) -> ET.Element:
    """Write a motor: in metres if it slides and its position is that of a joint, else in degrees."""
    low, high = motor.limits
    values = {"minPos": low, "maxPos": high, "home": min(max(motor.home, low), high)}
    values |= {"velocity": motor.max_velocity, "acceleration": motor.max_acceleration}
    texts = {"unit": "m"} if in_metres(robot, motor) else {}
    texts |= {name: (number if texts else degrees)(value) for name, value in values.items()}
    zone = {"zoneEndsAtHome": "true"} if motor.zone_ends_at_home else {}
    return ET.Element("motor", {"name": motor.name} | texts | {"torque": number(motor.max_torque)} | zone)


def _clause(robot: Robot, clause: Clause) -> ET.Element:
    """Write a clause: positions and offset in degrees, those of motors in metres in m."""
    metres = np.array([in_metres(robot, motor) for motor in robot.motor_table])
    element = ET.Element("constraintList")
    for row, offset in zip(clause.a, clause.b, strict=True):
        used = np.flatnonzero(row)
        names = " ".join(_clause_name(robot, k, clause.part) for k in used.tolist())
        factors, text = (row, number) if metres[used].all() else (np.where(metres, np.rad2deg(row), row), degrees)
        ET.SubElement(element, "constraint", a=numbers(factors[used]), q=names, b=text(offset))
    return element


def _clause_name(robot: Robot, motor: int, part: str) -> str:
    """Return the motor's name, or its index in the part where a list of motors would not be read with its name."""
    name = robot.motors[motor]
    return str(motor - robot.parts[part].start) if re.search(r"[\s,]|^-?[0-9]+$", name) else name


def _write_link(robot: Robot, drives: tuple[Drive, ...], into: ET.Element, link: int, point: Array, path: Path) -> None:
    """Write a link and everything mounted on it, in the order of the tree."""
    waiting = [(into, link, point, 2)]
    while waiting:
        element, here, origin, depth = waiting.pop()
        if depth > DEEPEST - 4:
            raise InvalidValue(f"link {robot.links[here]!r} is too deep in the tree: a file holds {DEEPEST} elements inside each other.")
        _write_body(robot, element, here, origin)
        element.extend(_visual_elements(robot, here, origin, path))
        for index, joint in enumerate(robot.joints):
            if joint.parent != here:
                continue
            step = joint.point - origin
            if np.abs(step).max() <= DIGITS:
                waiting.append((_joint(robot, drives[index], element, index), index + 1, origin, depth + 1))
            else:
                place = ET.SubElement(element, "link", _vector("xyz", step))
                waiting.append((_joint(robot, drives[index], place, index), index + 1, joint.point, depth + 2))


def _joint(robot: Robot, drive: Drive, into: ET.Element, index: int) -> ET.Element:
    joint: Joint = robot.joints[index]
    motor = robot.motor_table[drive.motor]
    ends = drive.scale * motor.limits + drive.offset
    text = degrees if joint.kind == "revolute" else number
    names = {"name": joint.name, "moves": robot.links[index + 1], "motor": motor.name}
    kind = {"type": "prismatic"} if joint.kind == "prismatic" else {}
    return ET.SubElement(into, "joint", names | kind | _vector("xyz", joint.axis) | {"minPos": text(ends[0]), "maxPos": text(ends[1])})


def _write_body(robot: Robot, element: ET.Element, link: int, origin: Array) -> None:
    """Write mass, shapes and markers of a link; the shapes of each part in a <bodypart> of its name, those of no part outside of it."""
    element.extend(_mass(body, origin) for body in robot.bodies if body.link == link)
    parts = {"": element}
    for index, shape in enumerate(robot.shapes):
        if shape.link != link:
            continue
        if shape.part and shape.part not in robot.parts:
            raise InvalidValue(f"shape {shape.name!r} is of part {shape.part!r}, which the robot does not have.")
        if shape.part not in parts:
            parts[shape.part] = ET.SubElement(element, "bodypart", name=shape.part)
        written = ET.SubElement(parts[shape.part], shape.kind, {"name": shape.name} | _volume(shape, origin))
        if shape.role == "field":
            written.set("field", "true")
        if (index in robot.base_shapes) != (link == 0):
            written.set("base", "true" if link else "false")
    for marker in robot.markers.values():
        if marker.link == link:
            place = _vector(("px", "py", "pz"), marker.position - origin) | _vector(("nx", "ny", "nz"), marker.normal)
            ET.SubElement(element, "marker", {"name": marker.name} | place | {"rotation": numbers(marker.rotation.reshape(9))})


def _visual_elements(robot: Robot, link: int, origin: Array, path: Path) -> Iterable[ET.Element]:
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


def _mass(body: Body, origin: Array) -> ET.Element:
    inertia = {} if body.inertia is None else {"inertia": numbers(to_six(body.inertia))}
    return ET.Element("mass", {"value": number(body.mass)} | _vector(("px", "py", "pz"), body.centre - origin) | inertia)


def _volume(shape: Shape, origin: Array) -> dict[str, str]:
    place = _vector(("px", "py", "pz"), shape.position - origin)
    match shape.kind:
        case "sphere":
            return {"radius": number(shape.size[0])} | place
        case "capsule" | "cylinder":
            size = {"radius": number(shape.size[0]), "height": number(shape.size[1])}
            return size | place | _vector(("hx", "hy", "hz"), shape.rotation[:, 2])
        case "box":
            width, height, depth = map(number, shape.size)
            return {"width": width, "height": height, "depth": depth} | place | _turn(shape.rotation)
    if shape.vertices is None:
        raise InvalidValue(f"the convex shape {shape.name!r} has no vertices.")
    return {"points": numbers((shape.vertices @ shape.rotation.T).reshape(-1))} | place


def _turn(rotation: Array) -> dict[str, str]:
    axis, angle = height_and_angle(rotation)
    return _vector(("hx", "hy", "hz"), axis) | {"angle": degrees(angle)}


def _vector(names: tuple[str, str, str] | str, vector: Array) -> dict[str, str]:
    return {name: number(value) for name, value in zip(names, vector, strict=True)}
