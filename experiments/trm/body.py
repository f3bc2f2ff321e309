"""What the examples share: the iCub at its table, the motors that move, and what its hands hold."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike

import mobee
from mobee import Geometry, Model, Robot, World
from mobee.robot.robot import Array

LEFT, RIGHT = "left_palm", "right_palm"
DOWN, UP, FORWARD, TO_THE_LEFT, TO_THE_RIGHT = (0, 0, -1), (0, 0, 1), (-1, 0, 0), (0, -1, 0), (0, 1, 0)  # root frame
FINGERS, THUMB = (1, 0, 0), (0, -1, 0)  # where they point, in the frame of either palm
THUMBS_UP = np.column_stack([FORWARD, DOWN, TO_THE_LEFT])  # the frame of a palm whose fingers point forward, its thumb up

_HELD = (0.85, 0.45, 0.10, 1.0)  # colour
_JOINTS = ("shoulder_pitch", "shoulder_roll", "shoulder_yaw", "elbow", "wrist_prosup", "wrist_pitch", "wrist_yaw")
_BENT = {  # degrees
    "thumb_oppose": 60,
    "thumb_proximal": 20,
    "thumb_distal": 30,
    "index_proximal": 35,
    "index_distal": 50,
    "middle_proximal": 35,
    "middle_distal": 50,
    "pinky": 80,
}
_ASIDE = {"shoulder_pitch": -40, "shoulder_roll": 40, "shoulder_yaw": -30, "elbow": 100}
_OUT = {"shoulder_pitch": 0, "shoulder_roll": 80, "shoulder_yaw": -20, "elbow": 70}
LEFT_ARM, RIGHT_ARM = (tuple(f"{side}_{joint}" for joint in _JOINTS) for side in "lr")  # without the hand
NECK = ("neck_pitch", "neck_roll", "neck_yaw")
ONE_HAND = ("torso", *RIGHT_ARM)
BOTH_HANDS = ("torso", *LEFT_ARM, *RIGHT_ARM)


def at_table() -> Model:
    """The iCub at its table, on which nothing is."""
    world = mobee.load_world("table")
    world.remove("ball")
    return Model(mobee.load_robot("icub"), world)


def alone() -> Model:
    """The iCub with nothing around it."""
    return Model(mobee.load_robot("icub"), World())


def carry(model: Model, name: str, shape: Geometry, marker: str, ahead: float, along: ArrayLike = FINGERS) -> None:
    """Show an object in a hand: its middle that far [m] before the palm, its z axis along a direction in the palm's frame."""
    m = model.robot.marker(marker)
    z = m.rotation @ np.asarray(along, dtype=np.float64)
    x = m.normal - (m.normal @ z) * z
    if not x.any():
        x = m.rotation @ np.asarray(FINGERS, dtype=np.float64)
    x = x / np.linalg.norm(x)
    model.world.add(name, shape, role="ghost", color=_HELD)
    model.world.attach(name, model.robot.links[m.link], (m.position + ahead * m.normal, np.column_stack([x, np.cross(z, x), z])))


def left_aside(robot: Robot) -> Array:
    """Home with the left arm bent out of the way, so that its hand does not meet the table when the torso leans, (n,) rad."""
    return changed(robot.home, robot, _ASIDE, "l")


def elbows_out(q: Array, robot: Robot, sides: str = "lr") -> Array:
    """A posture with the elbows at the sides, (n,) rad: about it hands can turn far without a jump."""
    return changed(q, robot, _OUT, sides)


def grasping(q: Array, robot: Robot, sides: str = "lr") -> Array:
    """A posture with bent fingers, (n,) rad."""
    return changed(q, robot, _BENT, sides)


def changed(q: Array, robot: Robot, degrees: Mapping[str, float], sides: str) -> Array:
    """A posture with some motors of the arms elsewhere, (n,) rad."""
    new = q.copy()
    for side in sides:
        for joint, angle in degrees.items():
            new[robot.motor_index(f"{side}_{joint}")] = np.deg2rad(angle)
    return new
