"""The iCub's motors: which joints each drives, its limits and where it is at home."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

from experiments.robots.xml_writer import element

HOME = {"shoulder_pitch": -26.0, "shoulder_roll": 20.0, "elbow": 60.0, "hand_finger": 10.0, "thumb_oppose": 30.0}
GAZE = {"neck_pitch": -26.0, "eyes_tilt": -18.0, "eyes_vergence": 11.0}  # on the table in front of the body, clear of the limits' forces
EYES = {"eyes_version": (-30.0, 30.0), "eyes_vergence": (0.0, 50.0)}  # version +- vergence / 2 just fills the URDF's pan limits
# finger axis -> joints that it drives; spread opens (0) to closed (60), so its joints end at 0
SPREAD = {"index_0": (-20.0, 0.0), "ring_0": (20.0, 0.0), "little_0": (20.0, 0.0)}
FINGERS = {
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


def motor_of(joint: str) -> str:
    """The motor that drives a joint: the joint's namesake, except in the hands."""
    side, _, rest = joint.partition("_hand_")
    finger = next((motor for motor, joints in FINGERS.items() if rest in joints), None)
    return f"{side}_{finger}" if finger else joint


def joint_interval(name: str, motor: str, limits: list[float]) -> tuple[float, float] | None:
    """The joint's interval [deg] where it is not the motor's own."""
    finger = name.partition("_hand_")[2]
    if finger in SPREAD:
        return SPREAD[finger]
    if motor.endswith(("distal", "pinky")):
        return limits[0], limits[1]
    return None


def declare_motors(parent: ET.Element, data: dict[str, Any], part: str) -> None:
    """A part's motors in YARP order; limits are the narrower of URDF and iCub simulator."""
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
