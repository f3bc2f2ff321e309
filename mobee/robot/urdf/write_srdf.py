"""The SRDF beside a URDF: parts as groups, home, and the pairs of links that are not tested."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree as ET

from mobee.robot.number_text import number
from mobee.robot.robot import Robot
from mobee.robot.urdf.pairs import adjacent_links


def write_srdf(robot: Robot, masters: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Write the SRDF; `masters`: for each motor the joint that stands for it in the URDF, with its scale and offset."""
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
    path.write_bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n")
