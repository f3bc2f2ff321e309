# SPDX-License-Identifier: Apache-2.0
"""Write mobee/robot/robots/icub_2014.xml, the iCub model published with MoBeE in 2014.

Source: the entries mobee_original (only numbers, no text, of the repository kailfrank/MoBeE) and shoulder_constraints.mobee_2014 of
DATA.json.  write_icub uses the functions at the end, too: those that add constraints and elements to XML, and format numbers and the
orientation of boxes.  The file format is described in mobee/robot/robots/README.md.

Usage: python -m experiments.robots.write_icub_2014 DATA.json [OUT.xml]
"""

from __future__ import annotations

import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from mobee.arrays import Array
from mobee.robot.xml.node import VERSION, write_tree
from mobee.robot.xml.volume import Y, angle_about, height_and_angle

OUT = Path(__file__).parents[2] / "mobee/robot/robots/icub_2014.xml"
HEADING = """
The iCub of MoBeE 2014, 41 motors, 108 solids and 66 fields. Written by experiments/robots/write_icub_2014.py; do not edit by hand.
Numbers from kailfrank/MoBeE (2014); names of motors, links and markers are those of icub.xml. Origin: README.md beside this file.
"""
PARTS = ("torso", "head", "left_arm", "right_arm")
MARKERS = {"head": "head", "eyeL": "left_eye", "eyeR": "right_eye", "left_hand": "left_palm", "right_hand": "right_palm"}
BASE_JOINTS = (2, 4)  # part of the base: they come before the first link and the first joint with a shape
LISTED_LENGTH = 1.0  # in the data, of an element that the file gives no length


class Tree:
    """The entry "mobee_original" of the JSON data, with dicts for look-ups.

    `data`: the whole JSON data.  `nodes`: id -> link or joint.  `motors`: part -> its motors.  `axis`: name of a motor in the data -> its
    name in YARP.  `joints`: name of a motor in YARP -> ids of the joints that it drives.  `links`: name of a joint in the entry
    models.icub_v2_5 -> name of the link that it moves.
    """

    def __init__(self, data: dict[str, Any]) -> None:
        model = data["mobee_original"]
        self.data = data
        self.motors: dict[str, list[dict[str, Any]]] = model["motors"]
        self.nodes = {node["id"]: node for node in model["nodes"]}
        self.primitives: list[dict[str, Any]] = model["primitives"]
        self.markers: list[dict[str, Any]] = model["markers"]
        self.axis = {motor["name"]: motor["yarp_axis"] for motors in self.motors.values() for motor in motors}
        self.joints = {motor["yarp_axis"]: motor["joint_nodes"] for motors in self.motors.values() for motor in motors}
        self.links = {joint["name"]: joint["child_link"] for joint in data["models"]["icub_v2_5"]["joints"]}

    def children(self, parent: int | None) -> list[dict[str, Any]]:
        """Return the children of the node with the id `parent` (None: the roots), part by part: torso, head, left arm, right arm."""
        mine = [node for node in self.nodes.values() if node["parent"] == parent]
        return sorted(mine, key=lambda node: PARTS.index(node["body_part"]))

    def joint_name(self, node: dict[str, Any]) -> str:
        """Return the name of a joint: that of its motor, with a number if the motor drives several joints, and with a side for the eyes."""
        motor = self.axis[node["motor"]]
        joints = self.joints[motor]
        if motor.startswith("eyes"):
            return f"{'lr'[joints.index(node['id'])]}_{motor}"
        return motor if len(joints) == 1 else f"{motor}_{joints.index(node['id'])}"


def main(data_path: str, out: str | Path = OUT) -> None:
    """Write the robot file `out` from the JSON data at `data_path`."""
    tree = Tree(json.loads(Path(data_path).read_text(encoding="utf-8")))
    root = ET.Element("ZeroPositionKinematicTree", version=VERSION, robotName="icub_2014", adjacency="recorded_2014")
    torso = element(root, "bodypart", name="torso")
    declare_motors(torso, tree, "torso")
    # The only deviation: by the recorded rule a torso bent to 47 deg would be in contact with its own pedestal, 4 mm deep.
    element(root, "ignore", first="root_link", second="chest", role="field")
    for node in tree.children(None):
        add_node(torso, tree, node)
    write_tree(root, Path(out), HEADING)


def declare_motors(parent: ET.Element, tree: Tree, part: str) -> None:
    """Add the motors of a part, and for an arm its linear constraints, to the XML element `parent`."""
    for motor in tree.motors[part]:
        low, high, home = motor["min_deg"], motor["max_deg"], motor["home_deg"]
        element(parent, "motor", name=motor["yarp_axis"], minPos=low, maxPos=high, home=home)
    if part.endswith("arm"):
        add_constraints(parent, tree.data)


def add_node(parent: ET.Element, tree: Tree, node: dict[str, Any]) -> None:
    """Add a link or a joint, with its shapes, markers and children, to the XML element `parent`.

    `node`: the link or joint, an entry of "nodes" in the JSON data.
    """
    if node["parent"] is not None and tree.nodes[node["parent"]]["body_part"] != node["body_part"]:
        part = next((old for old in parent.findall("bodypart") if old.get("name") == node["body_part"]), None)
        if part is None:
            part = element(parent, "bodypart", name=node["body_part"])
            declare_motors(part, tree, node["body_part"])
        parent = part
    mine = [shape for shape in tree.primitives if shape["node"] == node["id"]]
    drawn = {role: next((s for s in mine if s["implicit_from_node"] and s["role"] == role), None) for role in ("body", "field")}
    axis, point = np.array(node["axis_root"]), np.array(node["point_root"])
    if node["kind"] == "link":
        end = end_point(tree, node)
        name = {"name": "root_link"} if node["id"] == 0 else {}
        here = element(parent, "link", **name, **vector("x y z", end - point))
    else:
        end = point
        here = joint_element(parent, tree, node, axis)
    for role, attribute in (("body", "radius"), ("field", "field")):
        shape = drawn[role]
        if shape:
            here.set(attribute, number(shape["radius"]))
            if node["kind"] == "joint":
                here.set("length", number(shape["height"]))
    for shape in mine:
        if not shape["implicit_from_node"]:
            add_shape(here, shape, point)
    for marker in tree.markers:
        if marker["node"] == node["id"]:
            place = vector("px py pz", np.array(marker["point_root_zero_reference"]) - point)
            element(here, "marker", name=MARKERS[marker["name"]], **place, **vector("nx ny nz", np.array(marker["normal_node_frame"])))
    if node["kind"] == "joint" and tree.axis[node["motor"]].endswith("elbow"):
        element(here, "marker", name=f"{node['body_part'].removesuffix('_arm')}_elbow", nx="1")
    for child in tree.children(node["id"]):
        add_node(here, tree, child)


def joint_element(parent: ET.Element, tree: Tree, node: dict[str, Any], axis: Array) -> ET.Element:
    """Add a joint with its axis (3,), motor and limits to the XML element `parent`, and return the new element.

    The link that the joint moves gets its name from the iCub v2.5 (models.icub_v2_5 in the JSON data), as in icub.xml: the name of the link
    that the joint with the same name moves there.  If there is no such joint, the name is "<joint>_link".
    """
    name, motor = tree.joint_name(node), tree.axis[node["motor"]]
    here = element(parent, "joint", name=name, moves=tree.links.get(name, f"{name}_link"), motor=motor, **vector("x y z", axis))
    low, high = node["joint_limits_deg"]
    here.set("minPos", number(low))
    here.set("maxPos", number(high))
    if node["no_self_collision_subtree"]:
        here.set("noSelfCollision", "true")
    if node["id"] in BASE_JOINTS:
        here.set("base", "true")
    return here


def end_point(tree: Tree, node: dict[str, Any]) -> Array:
    """Return the point (3,) m, root frame at zero pose, at which a link ends.

    If the link has a child, it is the child's point in the data, so that rounding errors do not add up along the tree.  Otherwise it is
    computed from the link's start point, direction and length; the placeholder length LISTED_LENGTH (1.0) counts as 0.
    """
    for child in tree.nodes.values():
        if child["parent"] == node["id"]:
            return np.array(child["point_root"])
    length = 0.0 if node["length"] == LISTED_LENGTH else node["length"]
    return np.array(node["point_root"]) + length * np.array(node["axis_root"])


def add_shape(parent: ET.Element, shape: dict[str, Any], point: Array) -> None:
    """Add a sphere, cylinder or box to the XML element `parent`; its position is written relative to `point` (3,) m, root frame."""
    attributes = vector("px py pz", np.array(shape["center_root"]) - point)
    if shape["role"] == "field":
        attributes["field"] = "true"
    if shape["shape"] == "box":
        width, height, depth = shape["size_xyz_local"]
        element(parent, "box", width=width, height=height, depth=depth, **attributes, **box_turn(np.array(shape["R_root"])))
    elif shape["shape"] == "sphere":
        element(parent, "sphere", radius=shape["radius"], **attributes)
    else:
        turn = vector("hx hy hz", np.array(shape["axis_root"]))
        element(parent, "cylinder", radius=shape["radius"], height=shape["height"], **attributes, **turn)


def add_constraints(parent: ET.Element, data: dict[str, Any]) -> None:
    """Add the clauses of an arm, as in MoBeE 2014, to the XML element `parent` of the arm's part.

    A clause is a condition on several motors of the arm, which the shoulder's cables and the forearm impose.
    """
    for clause in data["shoulder_constraints"]["mobee_2014"]["full_cnf_per_arm"]:
        rows = element(parent, "constraintList")
        for row in clause:
            used = [(a, q) for a, q in zip(row["a"], row["motor_indices"], strict=True) if a]
            factors, motors = " ".join(number(a) for a, _ in used), " ".join(str(q) for _, q in used)
            element(rows, "constraint", a=factors, q=motors, b=row["b"])


def number(value: float, digits: int = 7) -> str:
    """Return a number as the shortest text with at most `digits` decimals."""
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text in ("-0", "") else text


def element(parent: ET.Element, tag: str, **attributes: str | float) -> ET.Element:
    """Add a child element with this tag and these attributes to `parent`, and return it; numbers become text."""
    texts = {name: value if isinstance(value, str) else number(value) for name, value in attributes.items()}
    return ET.SubElement(parent, tag, texts)


def vector(names: str, values: Array, digits: int = 7) -> dict[str, str]:
    """Return XML attributes with the components of a vector that are not zero, by name.

    `names`: names of the components, separated by spaces, as "px py pz".  `values`: the components.  `digits`: largest number of decimals.
    """
    texts = {name: number(value, digits) for name, value in zip(names.split(), values, strict=True)}
    return {name: text for name, text in texts.items() if text != "0"}


def box_turn(rotation: Array) -> dict[str, str]:
    """Return the XML attributes of a box with the orientation `rotation` (3, 3), root frame: hx, hy, hz (height axis) and angle [deg].

    Attributes with the default value are left out.
    """
    left, _, right = np.linalg.svd(rotation)
    exact = left @ right
    axis, _ = height_and_angle(exact)
    turn = {} if np.allclose(axis, Y, atol=1e-7) else vector("hx hy hz", axis)
    written = np.array([float(turn.get(name, 0.0)) for name in ("hx", "hy", "hz")]) if turn else Y
    if exact[1, 1] * axis[1] < 0:
        exact = exact * np.array([1.0, -1.0, -1.0])  # the same box
    angle = np.rad2deg(angle_about(written / np.linalg.norm(written), exact))
    return turn if abs(angle) < 1e-5 else turn | {"angle": number(float(angle), 6)}


if __name__ == "__main__":
    main(*sys.argv[1:])
