# SPDX-License-Identifier: Apache-2.0
"""Writes the upper body of the iCub, from the URDF of the package icub-models, for the simulator and the viewer."""

from __future__ import annotations

import importlib
import xml.etree.ElementTree as ET
from pathlib import Path

import defusedxml.ElementTree
import numpy as np

from mobee.errors import MobeeError
from mobee.robot.writing import numbers

MODEL = "iCubGazeboV2_5"
LEGS = ("l_hip_pitch", "r_hip_pitch")
PALM_FRAMES = ("l_hand_dh_frame", "r_hand_dh_frame")
DROPPED = ("gazebo", "sensor")
# PyBullet takes a frame without inertia for 1 kg, so the palm frames get a negligible one.
NEGLIGIBLE = {
    "mass": {"value": "1e-4"},
    "inertia": dict.fromkeys(("ixx", "iyy", "izz"), "1e-8") | dict.fromkeys(("ixy", "ixz", "iyz"), "0"),
}


def models_folder() -> Path:
    """Return the folder `iCub` of the installed package icub-models, which contains the folders `robots` and `meshes`.

    Raises MobeeError if the package is not installed, or if the folder has no URDF of the iCub (robots/iCubGazeboV2_5/model.urdf).
    """
    try:
        package = importlib.import_module("icub_models")
    except ModuleNotFoundError as error:
        raise MobeeError('the iCub\'s meshes are missing (package icub-models). Install them: pip install "mobee[sim]"') from error
    folder = Path(package.get_models_path()).parent
    if not (folder / "robots" / MODEL / "model.urdf").is_file():
        raise MobeeError(f'{folder} holds no robots/{MODEL}/model.urdf. Install icub-models again: pip install "mobee[sim]"')
    return folder


def write_upper_body_urdf(path: Path) -> Path:
    """Write the upper body of iCub v2.5 (without fingers and eyes) to `path` and return it.

    Legs, sensor frames and simulator tags are removed; axes are scaled to length 1; mesh paths become absolute. The frames of the palms,
    l_hand_dh_frame and r_hand_dh_frame, stay. Link names are those of `load_robot("icub")`. Raises MobeeError when icub-models is not
    installed.
    """
    folder = models_folder()
    root: ET.Element = defusedxml.ElementTree.parse(folder / "robots" / MODEL / "model.urdf").getroot()
    for child in [child for child in root if child.tag in DROPPED]:
        root.remove(child)
    for leg in LEGS:
        _remove_subtree(root, leg)
    while frames := _empty_frames(root):
        for joint in frames:
            _remove_subtree(root, joint)
    for link in root.iter("link"):
        if link.find("inertial") is None:
            inertial = ET.SubElement(link, "inertial")
            for tag, attributes in NEGLIGIBLE.items():
                ET.SubElement(inertial, tag, attributes)
    for mesh in root.iter("mesh"):
        mesh.set("filename", mesh.attrib["filename"].replace("package://iCub", folder.as_posix()))
    for axis in root.iter("axis"):  # PyBullet warns of axes with six digits
        direction = np.array(axis.attrib["xyz"].split(), dtype=float)
        axis.set("xyz", numbers(direction / np.linalg.norm(direction)))
    path.write_bytes(ET.tostring(root, encoding="utf-8", xml_declaration=True))
    return path


def _remove_subtree(root: ET.Element, joint_name: str) -> None:
    """Remove a joint, its child link and everything mounted on it."""
    joint = next(joint for joint in root.iter("joint") if joint.get("name") == joint_name)
    link = _end(joint, "child")
    root.remove(joint)
    for below in [other.attrib["name"] for other in root.iter("joint") if _end(other, "parent") == link]:
        _remove_subtree(root, below)
    root.remove(next(other for other in root.iter("link") if other.get("name") == link))


def _empty_frames(root: ET.Element) -> list[str]:
    """Return the names of the fixed joints whose child link has neither inertia nor joints; a joint to a palm's frame is not among them."""
    parents = {_end(joint, "parent") for joint in root.iter("joint")}
    heavy = {link.get("name") for link in root.iter("link") if link.find("inertial") is not None}
    return [
        joint.attrib["name"]
        for joint in root.iter("joint")
        if joint.get("type") == "fixed" and _end(joint, "child") not in parents | heavy | set(PALM_FRAMES)
    ]


def _end(joint: ET.Element, which: str) -> str:
    end = joint.find(which)
    return "" if end is None else end.attrib["link"]
