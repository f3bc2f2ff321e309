# SPDX-License-Identifier: Apache-2.0
"""Rewrites world files of VirtualSkin and MoBeE of 2011 to 2014 (root element <WorldList>) into the current XML grammar (<World>)."""

from __future__ import annotations

from collections import Counter

import numpy as np

from mobee.arrays import Array
from mobee.robot.writing import degrees
from mobee.robot.xml.node import Node, Remark, shown
from mobee.robot.xml.original import VOLUMES, at_line, free_name, vector_texts
from mobee.robot.xml.volume import AXIS, PLACE, UPRIGHT, Y, direction, height_along, height_and_angle, turn_about

LOWEST = 1e-6  # m; a shorter height axis counts as none, as in Qt


def rewrite_world_list(root: Node) -> list[Remark]:
    """Rewrite a <WorldList> of 2011 to 2014 into a <World>, in place; return remarks for the user on the interpretation.

    An object of a <WorldList> has a frame, and volumes whose poses are relative to this frame; in a <World> each volume is an object. If an
    object has one volume, the volume gets the object's name; if it has several, each gets the name with a number appended. Colours of 0 to
    255 are converted. A target exerted no force in 2014; here it repels all links except the hand that reaches for it.
    """
    remarks = [Remark(root, "read as a world of VirtualSkin or MoBeE, 2011 to 2014: <WorldList>", severity="note")]
    remarks += [Remark(at_line(root, repair.line), repair.what, repair.remedy) for repair in root.repairs]
    volumes: list[Node] = []
    taken: Counter[str] = Counter()
    for index, node in enumerate(root.children, start=1):
        if node.tag != "object":
            remarks.append(Remark(node, "unknown tag is ignored with all inside"))
            continue
        mine = [child for child in node if child.tag in VOLUMES]
        remarks += [Remark(child, "unknown tag is ignored with all inside") for child in node if child.tag not in VOLUMES]
        if not mine:
            remarks.append(Remark(node, "the object holds no volume and is ignored", "Put a <sphere>, <cylinder> or <box> into it"))
        given = node.optional("name") or f"object{index}"
        for number_of, child in enumerate(mine, start=1):
            name = given if len(mine) == 1 else f"{given}_{number_of}"
            taken[name] += 1
            if taken[name] > 1:
                remarks.append(
                    Remark(child, f"a second object {shown(name)!r} is called '{shown(name)}_{taken[name]}'", "Rename it", "note")
                )
                name = free_name(f"{name}_{taken[name]}", taken)
                taken[name] += 1
            volumes.append(_world_volume(node, child, name))
        if node.optional("type") == "target":
            what = "a target exerted no force in 2014; here it repels all but the link that reaches for it"
            remarks.append(Remark(node, what, 'Write role="ghost" for a thing without force', "note"))
    root.tag, root.children = "world", volumes
    return remarks


def _world_volume(thing: Node, volume: Node, name: str) -> Node:
    """Return one volume of an object with its pose in the root frame; raises RobotFileError if its type is not obstacle or target."""
    attributes = {key: text for key, text in volume.attributes.items() if key not in (*PLACE, *AXIS, "angle", "name")}
    frame, mirrored = _turned(thing)
    turn, _ = _turned(volume)
    shift = frame @ volume.vector(PLACE)
    rotation = frame @ turn
    attributes |= {"name": name} | vector_texts(PLACE, thing.vector(PLACE) + (-shift if mirrored else shift))
    if volume.tag == "box":
        axis, angle = height_and_angle(rotation)
        attributes |= vector_texts(AXIS, axis) | {"angle": degrees(angle)}
    elif volume.tag == "cylinder":
        attributes |= vector_texts(AXIS, rotation[:, 1])
    kind = thing.choice("type", thing.optional("type") or "obstacle", ("obstacle", "target"), "type of object")
    attributes["role"] = kind
    if thing.attributes.keys() & {"r", "g", "b"}:
        channels = [min(max(thing.number(channel, 0.0), 0.0), 255.0) / 255.0 for channel in "rgb"]
        attributes["color"] = " ".join(f"{channel:.4g}" for channel in [*channels, 1.0])
    return Node(volume.file, volume.line, volume.tag, attributes)


def _turned(node: Node) -> tuple[Array, bool]:
    """Return the rotation (3, 3) of an object or volume, and whether the program of 2014 mirrored it, as it did for an axis along -y."""
    if np.linalg.norm(node.vector(AXIS)) <= LOWEST:
        axis = Y
    else:
        axis = direction(node, AXIS)
    mirrored = bool(np.hypot(axis[0], axis[2]) <= UPRIGHT and axis[1] < 0)
    angle = np.deg2rad(node.number("angle", 0.0))
    if mirrored:  # every volume is symmetric about its centre: only the positions of an object's volumes are mirrored
        return turn_about(axis, angle), True
    return height_along(axis, angle), False
