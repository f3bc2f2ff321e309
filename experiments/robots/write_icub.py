# SPDX-License-Identifier: Apache-2.0
"""Write mobee/robot/robots/icub.xml, the iCub v2.5 upper body with 41 motors.

Source: the entries models.icub_v2_5 (derived from robotology/icub-models, CC BY-SA 4.0), yarp_parts and shoulder_constraints.mobee_2014 of
DATA.json.  The force fields (volumes around links that cause repulsive forces), and boxes that fit some meshes better than one primitive
per link, are not from there: they are chosen by hand, and listed below.  The file names the meshes of the installed icub-models, which
viewers draw.

Usage: python -m experiments.robots.write_icub DATA.json [OUT.xml]
"""

from __future__ import annotations

import json
import sys
import tempfile
import xml.etree.ElementTree as ET
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from experiments.robots.write_icub_2014 import add_constraints, box_turn, element, number, vector
from mobee.arrays import Array
from mobee.robot.bodies import to_six
from mobee.robot.icub_urdf import models_folder, write_upper_body_urdf
from mobee.robot.robot import Robot
from mobee.robot.urdf.read import read_urdf
from mobee.robot.xml.node import VERSION, write_tree
from mobee.robot.xml.volume import Z, align

OUT = Path(__file__).parents[2] / "mobee/robot/robots/icub.xml"
HEADING = """
iCub v2.5 upper body, 41 motors. Written by experiments/robots/write_icub.py; do not edit by hand.
SPDX-FileCopyrightText: Istituto Italiano di Tecnologia
SPDX-FileCopyrightText: The MoBeE developers
SPDX-License-Identifier: CC-BY-SA-4.0
Kinematics, solids and masses derive from icub-models 3.2.0 (https://github.com/robotology/icub-models), (c) Istituto Italiano di
Tecnologia, CC BY-SA 4.0 (https://creativecommons.org/licenses/by-sa/4.0/); this file is distributed under the same licence.
Changed: zero-position form; boxes and capsules touch instead of meshes, and are drawn as hands; covers are grey instead of red; added
fields, motors, limits, couplings, constraints, markers.
Origin of every number: README.md beside this file.
"""
COVERS = (0.3, 0.34, 0.4, 1.0)  # colour of the URDF's red parts: red is the colour of contacts, and of the ball
SKIN = "0.9 0.9 0.9 1"
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
HOME = {"shoulder_pitch": -26.0, "shoulder_roll": 20.0, "elbow": 60.0, "hand_finger": 10.0, "thumb_oppose": 30.0}
GAZE = {"neck_pitch": -26.0, "eyes_tilt": -18.0, "eyes_vergence": 11.0}  # on the table in front of the body, clear of the limits' forces
EYES = {"eyes_version": (-30.0, 30.0), "eyes_vergence": (0.0, 50.0)}  # version +- vergence / 2 just fills the URDF's pan limits
# Limits [deg] of the spread of fingers: the motor goes from open (0) to closed (60), so its joints end at 0.
SPREAD = {"index_0": (-20.0, 0.0), "ring_0": (20.0, 0.0), "little_0": (20.0, 0.0)}
FINGERS = {  # joints that each motor of a hand drives
    "hand_finger": ("index_0", "ring_0", "little_0"),
    "thumb_oppose": ("thumb_0",),
    "thumb_proximal": ("thumb_1",),
    "thumb_distal": ("thumb_2", "thumb_3"),
    "index_proximal": ("index_1",),
    "index_distal": ("index_2", "index_3"),
    "middle_proximal": ("middle_1",),
    "middle_distal": ("middle_2", "middle_3"),
    "pinky": ("ring_1", "ring_2", "ring_3", "little_1", "little_2", "little_3"),
}

Point = tuple[float, float, float]
Field = tuple[str, str, float, Point, Point]  # name, link, radius, one end, other end (equal: a sphere)

# Volumes that are chosen by hand, in m, root frame, with the robot in its zero pose.  The fields are few spheres and capsules around the
# solids of each body section.  They extend beyond the solids by 5 to 7 cm at hand and fingers, 5 cm at the forearm, 3 to 4 cm at elbow,
# torso and head, and 3 cm at the upper arm.  At the flanks of pelvis and chest it is only 1 cm, because an arm hangs beside them at home.
# Those of the right arm are the mirror images of the left one's (y is negated).
TRUNK: list[Field] = [
    ("pelvis_field", "root_link", 0.095, (0.03, -0.045, -0.045), (0.03, 0.045, -0.045)),
    ("pelvis_back_field", "root_link", 0.095, (0.06, 0.0, -0.03), (0.06, 0.0, -0.11)),
    ("pelvis_front_field", "root_link", 0.085, (0.0, 0.0, -0.04), (0.0, 0.0, -0.12)),
    ("lower_torso_field", "torso_1", 0.085, (0.0075, 0.0, 0.023), (0.0075, 0.0, 0.023)),
    ("waist_field", "torso_2", 0.085, (0.0, 0.0, 0.04), (0.0, 0.0, 0.11)),
    ("belly_field", "chest", 0.09, (-0.03, -0.025, 0.10), (-0.03, 0.025, 0.10)),
    ("breast_field", "chest", 0.09, (-0.035, -0.04, 0.18), (-0.035, 0.04, 0.18)),
    ("back_field", "chest", 0.11, (0.12, -0.02, 0.11), (0.12, 0.02, 0.11)),
    ("shoulder_blades_field", "chest", 0.11, (0.12, -0.045, 0.185), (0.12, 0.045, 0.185)),
    ("flank_field", "chest", 0.09, (0.035, -0.04, 0.10), (0.035, 0.04, 0.10)),
    ("shoulder_girdle_field", "chest", 0.09, (0.035, -0.045, 0.19), (0.035, 0.045, 0.19)),
]
HEAD: list[Field] = [
    ("face_field", "head", 0.11, (-0.03, 0.0, 0.325), (-0.025, 0.0, 0.375)),
    ("back_of_head_field", "head", 0.117, (0.03, 0.005, 0.33), (0.025, 0.005, 0.375)),
]
LEFT_ARM: list[Field] = [
    ("shoulder_field", "shoulder_1", 0.07, (-0.0106, -0.1094, 0.1748), (-0.0106, -0.1094, 0.1748)),
    ("upper_arm_field", "shoulder_3", 0.085, (-0.011, -0.1095, 0.095), (-0.011, -0.1095, 0.045)),
    ("elbow_field", "shoulder_3", 0.085, (-0.021, -0.1064, 0.005), (-0.021, -0.1064, 0.005)),
    ("forearm_field", "forearm", 0.096, (-0.006, -0.108, -0.03), (-0.006, -0.108, -0.11)),
    ("palm_field", "hand", 0.09, (-0.011, -0.096, -0.14), (-0.011, -0.096, -0.175)),
    ("fingers_field", "hand", 0.085, (-0.03, -0.093, -0.245), (0.012, -0.092, -0.245)),
    ("thumb_field", "hand", 0.08, (-0.08, -0.083, -0.192), (-0.08, -0.083, -0.192)),
]
# Fields only, the solids there are tested: an upper arm hangs beside the trunk, a bowed head comes near waist and shoulders.
BESIDE = [
    *((f"{side}_shoulder_{k}", trunk) for side in "lr" for k in (1, 3) for trunk in ("root_link", "torso_1", "torso_2")),
    *(("head", neighbour) for neighbour in ("torso_2", "l_shoulder_1", "r_shoulder_1")),
]
# The entry models.icub_v2_5 of the JSON data encloses the pelvis in a box, the chest in a cylinder and the head in a sphere.  They have 1.5
# to 1.7 times the volume of the convex hull of the mesh, and pelvis and upper arm would touch at home.  These boxes replace them.  The mesh
# in icub-models (CC BY-SA 4.0) is cut horizontally into slices; each box is the bounding box of a slice, rounded outwards to 1 mm.
BOXES: dict[str, list[tuple[Point, Point]]] = {
    "root_link": [
        ((-0.028, -0.075, -0.156), (0.101, 0.075, -0.088)),
        ((-0.042, -0.111, -0.088), (0.104, 0.111, -0.014)),
        ((-0.032, -0.105, -0.016), (0.093, 0.105, 0.006)),
        ((-0.032, -0.1, 0.004), (0.079, 0.1, 0.032)),
    ],
    "chest": [
        ((-0.079, -0.076, 0.041), (0.166, 0.076, 0.07)),
        ((-0.085, -0.097, 0.07), (0.191, 0.097, 0.155)),
        ((-0.085, -0.122, 0.155), (0.194, 0.122, 0.19)),
        ((-0.078, -0.096, 0.19), (0.193, 0.096, 0.22)),
        ((-0.057, -0.085, 0.22), (0.183, 0.085, 0.247)),
        ((-0.031, -0.045, 0.247), (0.029, 0.045, 0.274)),
    ],
    "head": [
        ((-0.093, -0.066, 0.268), (0.089, 0.066, 0.292)),
        ((-0.1, -0.077, 0.292), (0.111, 0.093, 0.385)),
        ((-0.091, -0.076, 0.385), (0.107, 0.077, 0.43)),
        ((-0.068, -0.061, 0.43), (0.079, 0.061, 0.453)),
    ],
}


def main(data_path: str, out: str | Path = OUT) -> None:
    """Write the robot file `out` from the JSON data at `data_path`."""
    data = json.loads(Path(data_path).read_text(encoding="utf-8"))
    model = data["models"]["icub_v2_5"]
    root = ET.Element("ZeroPositionKinematicTree", version=VERSION, robotName="icub")
    torso = element(root, "bodypart", name="torso")
    declare_motors(torso, data, "torso")
    base = element(torso, "link", name="root_link")
    add_shapes(base, model, "root_link", np.zeros(3))
    add_fields(base, "root_link", np.zeros(3))
    add_visuals(base, model, "root_link", np.zeros(3))
    for first, second in BESIDE:
        element(root, "ignore", first=first, second=second, role="field")
    add_joints(torso, data, "root_link", np.zeros(3))
    write_tree(root, Path(out), HEADING)


def add_joints(parent: ET.Element, data: dict[str, Any], link: str, point: Array) -> None:
    """Add the joints that are mounted on the link `link`, with everything that they carry, to the XML element `parent`.

    `data`: the JSON data.  `point`: (3,) m, root frame at zero pose, origin of `parent`.
    """
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
    """Add a joint with all that it moves (mass, shapes, force fields, markers, further joints) to the XML element `parent`.

    The joint is placed in a link element, which holds the displacement from `parent` to the joint.  `data`: the JSON data.  `joint`: its
    entry in the data.  `point`: (3,) m, root frame at zero pose, origin of `parent`.
    """
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
    for source in carried:
        add_visuals(pan, data["models"]["icub_v2_5"], source, here)
    add_markers(pan, data, link, here)
    for source in carried if link.endswith("hand") else [link]:
        add_joints(pan, data, source, here)


def skeleton_point(name: str, point: Array, axis: Array) -> Array:
    """Return the point (3,) m on a joint's axis through which the body's skeleton is drawn.

    ANCHORS has one position (m, root frame at zero pose) for a joint or for a group of joints, such as the shoulder; for the right arm, its
    y is negated.  The returned point is the point of the axis nearest to this position.  For a joint without an entry in ANCHORS it is
    `point`.  `name`: name of the joint.  `point`: (3,) m, a point on the axis.  `axis`: (3,), unit vector of its direction.  Both are in
    the root frame at zero pose.
    """
    plain = name.removeprefix("l_").removeprefix("r_")
    key = next((key for key in (plain, plain.split("_")[0]) if key in ANCHORS), None)
    if key is None:
        return point
    side = -1.0 if name.startswith("r_") else 1.0
    return point + axis * float(axis @ (np.array(ANCHORS[key]) * (1.0, side, 1.0) - point))


def motor_of(joint: str) -> str:
    """Return the name of the motor that drives a joint: the joint's own name, except in the hands."""
    side, _, rest = joint.partition("_hand_")
    finger = next((motor for motor, joints in FINGERS.items() if rest in joints), None)
    return f"{side}_{finger}" if finger else joint


def joint_interval(name: str, motor: str, limits: list[float]) -> tuple[float, float] | None:
    """Return the range of a joint [deg], lowest and highest; None if it equals the range of its motor.

    `limits`: range of the joint in the data, deg.
    """
    finger = name.partition("_hand_")[2]
    if finger in SPREAD:
        return SPREAD[finger]
    if motor.endswith(("distal", "pinky")):
        return limits[0], limits[1]
    return None


def declare_motors(parent: ET.Element, data: dict[str, Any], part: str) -> None:
    """Add the motors of a part to the XML element `parent`, in YARP's order.

    Their limits are those of the URDF or of the iCub simulator, whichever are narrower.
    """
    parts = data["yarp_parts"]
    joints = {j["name"]: j for j in data["models"]["icub_v2_5"]["joints"]}
    simulator = parts["limits_deg"]["icub_simulator"]["arm" if part.endswith("arm") else part]
    for name, (low, high) in zip(parts["order"][part], simulator, strict=True):
        if name in EYES:
            low, high = EYES[name]
        elif name in joints:
            low, high = max(low, joints[name]["limits_deg"][0]), min(high, joints[name]["limits_deg"][1])
        home = HOME.get(name[2:], 0.0) if part.endswith("arm") else GAZE.get(name, 0.0)
        element(parent, "motor", name=name, minPos=low, maxPos=high, home=home)


def add_mass(parent: ET.Element, joint: dict[str, Any], point: Array) -> None:
    """Add the mass that moves with a joint to the XML element `parent`; positions are written relative to `point` (3,) m, root frame.

    Fingers and eyes get no mass: their values in icub-models, 0.01 kg and 0.001 kg m^2 each, are placeholders.  The simulator loads another
    model of icub-models, which has no fingers and eyes; its hands and head have the masses that are written here.
    """
    if "_hand_" in joint["name"] or "eye" in joint["name"]:
        return
    place = vector("px py pz", np.array(joint["body_com_root"]) - point)
    inertia = " ".join(number(value, 9) for value in to_six(np.array(joint["body_inertia_com_root_axes"])))
    element(parent, "mass", value=joint["body_mass_kg"], **place, inertia=inertia)


def add_shapes(parent: ET.Element, model: dict[str, Any], link: str, point: Array) -> None:
    """Add the collision shapes of a link to the XML element `parent`; positions are written relative to `point` (3,) m, root frame.

    `model`: the entry models.icub_v2_5 of the JSON data.  Links that are listed in BOXES get these boxes instead of the shapes in `model`.
    """
    for index, (low, high) in enumerate(np.array(BOXES.get(link, ())).reshape(-1, 2, 3)):
        width, height, depth = high - low
        place = vector("px py pz", (low + high) / 2 - point)
        element(parent, "box", name=f"{link}_{index}", width=width, height=height, depth=depth, **place)
    for shape in model["primitives"]:
        if shape["link"] != link or link in BOXES:
            continue
        place = vector("px py pz", np.array(shape["center"]) - point)
        if shape["shape"] == "sphere":
            element(parent, "sphere", name=shape["name"], radius=shape["radius"], **place)
        elif shape["shape"] == "cylinder":
            turn = vector("hx hy hz", np.array(shape["axis"]))
            element(parent, "cylinder", name=shape["name"], radius=shape["radius"], height=shape["height"], **place, **turn)
        else:
            width, height, depth = shape["size"]
            turn = box_turn(np.array(shape["R"]))
            element(parent, "box", name=shape["name"], width=width, height=height, depth=depth, **place, **turn)


def add_fields(parent: ET.Element, link: str, point: Array) -> None:
    """Add the force fields of a link (spheres and capsules that cause repulsive forces) to the XML element `parent`.

    Positions are written relative to `point` (3,) m, root frame.
    """
    for name, host, radius, first, second in fields():
        if host != link:
            continue
        ends = np.array([first, second])
        place = vector("px py pz", ends.mean(axis=0) - point)
        span = ends[1] - ends[0]
        if span.any():
            height = float(np.linalg.norm(span))
            turn = vector("hx hy hz", span / height)
            element(parent, "capsule", name=name, radius=radius, height=height, field="true", **place, **turn)
        else:
            element(parent, "sphere", name=name, radius=radius, field="true", **place)


def fields() -> list[Field]:
    """Return the force fields of all links (spheres and capsules that cause repulsive forces), each as a tuple.

    The tuple is (name, link, radius [m], first end, second end).  The ends (3,) m of the capsule's axis are in the root frame at zero pose;
    they are equal for a sphere.
    """
    mirror = [(n, k, r, (a[0], -a[1], a[2]), (b[0], -b[1], b[2])) for n, k, r, a, b in LEFT_ARM]
    arms = [(f"l_{n}", f"l_{k}", r, a, b) for n, k, r, a, b in LEFT_ARM] + [(f"r_{n}", f"r_{k}", r, a, b) for n, k, r, a, b in mirror]
    return TRUNK + HEAD + arms


def add_visuals(parent: ET.Element, model: dict[str, Any], link: str, point: Array) -> None:
    """Add what viewers draw of a link to the XML element `parent`: the meshes of the URDF; for hands and fingers, the collision shapes.

    Positions are written relative to `point` (3,) m, root frame; the link has the same zero pose in the URDF. The URDF's mesh of a hand
    cannot be used: palm and fingers are one piece, so the fingers would not move.
    """
    if "hand" in link:
        for shape in model["primitives"]:
            if shape["link"] == link:
                rotation = align(Z, np.array(shape["axis"])) if shape["shape"] == "cylinder" else np.array(shape.get("R", np.eye(3)))
                size = shape["size"] if shape["shape"] == "box" else [shape[name] for name in ("radius", "height") if name in shape]
                text, rows = " ".join(map(number, size)), " ".join(number(value, 9) for value in rotation.ravel())
                place = vector("px py pz", np.array(shape["center"]) - point)
                element(parent, "visual", shape=shape["shape"], size=text, color=SKIN, **place, rotation=rows)
        return
    source = drawn()
    for visual in source.visuals:
        if source.links[visual.link] == link and visual.mesh is not None and visual.color is not None:
            file = "package://iCub/" + Path(visual.mesh.file).relative_to(models_folder()).as_posix()
            red, green, blue, _ = visual.color
            color = COVERS if red > 1.5 * max(green, blue) else visual.color
            scale, colors = (" ".join(map(number, values)) for values in (visual.mesh.scale, color))
            rows = " ".join(number(value, 9) for value in visual.rotation.ravel())
            element(parent, "visual", file=file, scale=scale, color=colors, **vector("px py pz", visual.position - point), rotation=rows)


@cache
def drawn() -> Robot:
    """Return the robot that the URDF of icub-models describes; every call returns the same object."""
    with tempfile.TemporaryDirectory() as folder:
        return read_urdf(write_upper_body_urdf(Path(folder) / "icub.urdf"))


def add_markers(parent: ET.Element, data: dict[str, Any], link: str, point: Array) -> None:
    """Add the markers of a link (named frames with a normal direction: palms, elbows, eyes and head) to the XML element `parent`.

    `point`: origin of `parent`, (3,) m, root frame at zero pose.
    """
    model = data["models"]["icub_v2_5"]
    palms = model["end_effector_zero_root"]
    for side, sign in (("left", -1.0), ("right", 1.0)):
        if link == f"{side[0]}_hand":
            rotation = np.array(palms[side]["R"])
            add_marker(parent, f"{side}_palm", np.array(palms[side]["p"]) - point, rotation, sign * rotation[:, 2])
        if link == f"{side[0]}_elbow_1":
            add_marker(parent, f"{side}_elbow", np.zeros(3), np.eye(3), np.array([1.0, 0.0, 0.0]))
        if link == f"{side[0]}_eye":
            add_marker(parent, f"{side}_eye", np.zeros(3), np.eye(3), np.array([-1.0, 0.0, 0.0]))
    if link == "head":
        head = model["head_zero_root"]
        add_marker(parent, "head", np.array(head["p"]) - point, np.array(head["R"]), np.array([-1.0, 0.0, 0.0]))


def add_marker(parent: ET.Element, name: str, place: Array, rotation: Array, normal: Array) -> None:
    """Add one marker to the XML element `parent`.

    `place`: (3,) m, relative to the origin of `parent`.  `rotation`: (3, 3), orientation of the marker's frame.  `normal`: (3,), the
    direction in which the marker faces, out of a palm for instance.  Both are in root axes at zero pose.
    """
    rows = " ".join(number(value) for value in rotation.ravel())
    element(parent, "marker", name=name, rotation=rows, **vector("px py pz", place), **vector("nx ny nz", normal))


if __name__ == "__main__":
    main(*sys.argv[1:])
