"""Reads and writes masses as <inertial>."""

from __future__ import annotations

from collections.abc import Iterator
from xml.etree import ElementTree as ET

import numpy as np

from mobee.arrays import Array
from mobee.robot.bodies import ball_of_water, from_six, one_a_link, to_six
from mobee.robot.robot import Body
from mobee.robot.urdf.frames import Frame, bounded, child, read_origin
from mobee.robot.urdf.layout import Skeleton
from mobee.robot.urdf.tree import Tree
from mobee.robot.writing import number, numbers
from mobee.robot.xml.node import SMALLEST, Node

SIX = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def read_bodies(tree: Tree, skeleton: Skeleton) -> tuple[Body, ...]:
    """The masses of all links, those of fixed joints with what carries them; raises RobotFileError."""
    return one_a_link(_bodies(tree, skeleton))


def _bodies(tree: Tree, skeleton: Skeleton) -> Iterator[Body]:
    for name, link in skeleton.index.items():
        inertial = child(tree.links[name], "inertial")
        mass = None if inertial is None else child(inertial, "mass")
        if inertial is None or mass is None:
            continue
        value = bounded(mass, "value")
        if value < 0:
            mass.fail("value", f"{value:g} is negative", "Write the mass in kilograms, or leave <inertial> out")
        if value >= SMALLEST:  # exporters write 0 for frames
            place = skeleton.frames[name] @ read_origin(inertial)
            yield Body(link, value, place.position, _inertia(inertial, place))


def _inertia(inertial: Node, place: Frame) -> Array | None:
    """About the centre of mass, along the root frame's axes; None where the file knows none, or one that cannot be."""
    node, note = child(inertial, "inertia"), child(inertial, "mobee")
    if node is None or (note is not None and note.flag("assumed")):
        return None
    inertia = place.rotation @ from_six([bounded(node, name, 0.0) for name in SIX]) @ place.rotation.T
    return inertia if inertia.any() else None


def inertial_element(body: Body, point: Array) -> ET.Element:
    """An <inertial> in a link's frame that stands at `point` (3,) m and is not turned.

    URDF demands moments of inertia: where there are none, those of a ball of water of that mass, marked as assumed.
    """
    element = ET.Element("inertial")
    ET.SubElement(element, "origin", xyz=numbers(body.centre - point), rpy="0 0 0")
    ET.SubElement(element, "mass", value=number(body.mass))
    inertia = ball_of_water(body.mass) if body.inertia is None else np.asarray(body.inertia)
    ET.SubElement(element, "inertia", dict(zip(SIX, map(number, to_six(inertia)), strict=True)))
    if body.inertia is None:
        ET.SubElement(element, "mobee", assumed="true")
    return element
