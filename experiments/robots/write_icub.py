"""Writes mobee/robot/robots/icub.xml, the iCub v2.5 upper body with 41 motors.

Source: data models.icub_v2_5 (derived from robotology/icub-models, CC BY-SA 4.0), yarp_parts, shoulder_constraints.mobee_2014;
fields are ours. Usage: python -m experiments.robots.write_icub DATA.json [OUT.xml]
"""

from __future__ import annotations

import json
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import numpy as np

from experiments.robots.icub_carried import add_fields, add_markers, add_mass, add_shapes
from experiments.robots.icub_fields import BESIDE
from experiments.robots.icub_motors import EYES, declare_motors, joint_interval, motor_of
from experiments.robots.xml_writer import element, number, vector, write
from mobee.arrays import Array
from mobee.robot.xml.node import VERSION

OUT = Path(__file__).parents[2] / "mobee/robot/robots/icub.xml"
HEADING = """
iCub v2.5 upper body, 41 motors. Written by experiments/robots/write_icub.py; do not edit by hand.
SPDX-FileCopyrightText: Istituto Italiano di Tecnologia
SPDX-FileCopyrightText: The MoBeE developers
SPDX-License-Identifier: CC-BY-SA-4.0
Kinematics, solids and masses derive from icub-models 3.2.0 (https://github.com/robotology/icub-models), (c) Istituto Italiano di
Tecnologia, CC BY-SA 4.0 (https://creativecommons.org/licenses/by-sa/4.0/); this file is distributed under the same licence.
Changed: zero-position form; boxes and capsules instead of meshes; added fields, motors, limits, couplings, constraints, markers.
Origin of every number: README.md beside this file.
"""
# A point on a joint's axis is free along the axis; the foot of these points draws the body's skeleton (thesis 2.3.1).
ANCHORS = {
    "torso": (0.0, 0.0, 0.032),
    "neck": (-0.0108093, 0.0, 0.254797),
    "shoulder": (-0.0106198, -0.109391, 0.1748),
    "elbow": (-0.0106198, -0.109391, 0.01574),
    "wrist_prosup": (-0.0106198, -0.109391, 0.01574),
    "wrist": (-0.0084698, -0.109398, -0.12656),
}
RIGID = {"l_upper_arm": "l_shoulder_3", "r_upper_arm": "r_shoulder_3", "l_hand_middle_0": "l_hand", "r_hand_middle_0": "r_hand"}


def main(data_path: str, out: str | Path = OUT) -> None:
    """Write the file."""
    data = json.loads(Path(data_path).read_text(encoding="utf-8"))
    model = data["models"]["icub_v2_5"]
    root = ET.Element("ZeroPositionKinematicTree", version=VERSION, robotName="icub")
    torso = element(root, "bodypart", name="torso")
    declare_motors(torso, data, "torso")
    base = element(torso, "link", name="root_link")
    add_shapes(base, model, "root_link", np.zeros(3))
    add_fields(base, "root_link", np.zeros(3))
    for first, second in BESIDE:
        element(root, "ignore", first=first, second=second, role="field")
    add_joints(torso, data, "root_link", np.zeros(3))
    write(root, Path(out), HEADING)


def add_joints(parent: ET.Element, data: dict[str, Any], link: str, point: Array) -> None:
    """The joints mounted on a link, with all that they carry."""
    joints = [j for j in data["models"]["icub_v2_5"]["joints"] if RIGID.get(j["parent_link"], j["parent_link"]) == link]
    parts = ["torso", "head", "left_arm", "right_arm"]
    for joint in sorted(joints, key=lambda j: parts.index(j["body_part"])):
        if joint["child_link"] in RIGID:  # a joint without a motor: its link is one with the parent
            add_joints(parent, data, joint["child_link"], point)
            continue
        place = parent
        if link == "chest":
            place = element(parent, "bodypart", name=joint["body_part"])
            declare_motors(place, data, joint["body_part"])
            if joint["body_part"].endswith("arm"):
                add_constraints(place, data)
        add_joint(place, data, joint, point)


def add_joint(parent: ET.Element, data: dict[str, Any], joint: dict[str, Any], point: Array) -> None:
    """A joint, after the displacement that leads to it, with shapes, fields, markers and all that it carries."""
    axis = np.array(joint["axis_root"])
    here = skeleton_point(joint["name"], np.array(joint["point_root"]), axis)
    link, name = joint["child_link"], joint["name"].removesuffix("_joint")
    step = element(parent, "link", **vector("x y z", here - point))
    if name.endswith("eye_pan"):
        side = 1 if name.startswith("l") else -1
        version = element(step, "joint", name=f"{link}_version", motor="eyes_version", **vector("x y z", axis))
        half = EYES["eyes_vergence"][1] / 2 * side
        pan = element(version, "joint", name=f"{link}_vergence", moves=link, motor="eyes_vergence", **vector("x y z", axis))
        pan.set("minPos", "0")
        pan.set("maxPos", number(half))
    else:
        pan = element(step, "joint", name=name, moves=link, motor=motor_of(name), **vector("x y z", axis, 9))
        interval = joint_interval(name, motor_of(name), joint["limits_deg"])
        if interval:
            pan.set("minPos", number(interval[0]))
            pan.set("maxPos", number(interval[1]))
    if name.endswith("wrist_pitch"):
        pan.set("noSelfCollision", "true")
    add_mass(pan, joint, here)
    carried = [link, *(rigid for rigid, host in RIGID.items() if host == link)]
    for source in carried:
        add_shapes(pan, data["models"]["icub_v2_5"], source, here)
    add_fields(pan, link, here)
    add_markers(pan, data, link, here)
    for source in carried if link.endswith("hand") else [link]:
        add_joints(pan, data, source, here)


def skeleton_point(name: str, point: Array, axis: Array) -> Array:
    """The point on the joint's axis nearest to its cluster's anchor."""
    plain = name.removeprefix("l_").removeprefix("r_")
    key = next((key for key in (plain, plain.split("_")[0]) if key in ANCHORS), None)
    if key is None:
        return point
    side = -1.0 if name.startswith("r_") else 1.0
    return point + axis * float(axis @ (np.array(ANCHORS[key]) * (1.0, side, 1.0) - point))


def add_constraints(parent: ET.Element, data: dict[str, Any]) -> None:
    """The cable and forearm clauses of an arm, as in MoBeE 2014."""
    for clause in data["shoulder_constraints"]["mobee_2014"]["full_cnf_per_arm"]:
        rows = element(parent, "constraintList")
        for row in clause:
            used = [(a, q) for a, q in zip(row["a"], row["motor_indices"], strict=True) if a]
            factors, motors = " ".join(number(a) for a, _ in used), " ".join(str(q) for _, q in used)
            element(rows, "constraint", a=factors, q=motors, b=row["b"])


if __name__ == "__main__":
    main(*sys.argv[1:])
