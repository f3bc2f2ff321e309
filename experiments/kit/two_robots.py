# SPDX-License-Identifier: Apache-2.0
"""The iCub and the Katana on its table as one robot model (thesis figure 4.5), and the ball that the Katana carries.

Both have fields: larger volumes around the links, which cause repulsive forces.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np

from mobee.arrays import Array
from mobee.derivation.derive import derive
from mobee.robot.join import join_robots
from mobee.robot.load import load_robot
from mobee.robot.robot import Robot
from mobee.robot.urdf.shapes import grown
from mobee.vision.teaching.lessons import Carried

ICUB, KATANA = ("torso", "head", "left_arm", "right_arm"), ("katana_arm", "katana_hand")
"""The names of the parts of each robot, as in the joined robot."""
BASE = np.array([-0.5, 0.4, 0.106])  # m: of the Katana, as in icub_katana.xml
BALL = Carried("katana_arm_4", BASE + np.array([-0.386, 0.0, -0.01]))
"""The ball that the Katana carries, at the tips of its closed fingers."""
WIDTH = 0.06  # m, of the Katana's fields against the iCub: the widest of those that `derive` makes
CLOSED = 0.2  # rad, of the Katana's hand from its limit
SIDEWAYS = {"shoulder_pitch": -2.0, "shoulder_roll": 65.0, "elbow": 28.0}  # degrees: arms out of the shared workspace


@cache
def two_robots() -> Robot:
    """Return the iCub and the Katana joined into one robot; names of the Katana begin with "katana_".  Every call returns the same object.

    The Katana's file has no fields, the volumes around links that cause repulsive forces.  Here the Katana gets two sets.  Its narrow
    fields are tested against its own links, because wide ones would overlap each other.  Its wide fields (6 cm) are tested only against the
    fields of the iCub.
    """
    icub, katana = load_robot("icub"), derive(load_robot("katana")).robot
    wide = [grown(solid, WIDTH, f"{solid.name}_wide_field") for solid in katana.shapes if solid.role == "solid" and solid.link > 0]
    katana = replace(
        katana, shapes=(*katana.shapes, *wide), least_lever=icub.least_lever
    )  # else contacts of short levers push the iCub less
    robots = {"": icub, "katana": katana}
    return join_robots(robots, {"katana": (BASE, np.eye(3))}, "icub_katana")


def motors_of(parts: tuple[str, ...]) -> slice:
    """Return the slice of the motors of `parts` in the joined robot; the parts must be adjacent, in the order of the robot."""
    slices = [two_robots().part(part).slice for part in parts]
    return slice(slices[0].start, slices[-1].stop)


def watching() -> Array:
    """Return the posture (n,) rad of both robots with the iCub's arms aside, the Katana's hand closed, and all other motors at home."""
    robot = two_robots()
    q: Array = robot.home.copy()
    for side in "lr":
        for name, degrees in SIDEWAYS.items():
            q[robot.motor_index(f"{side}_{name}")] = np.deg2rad(degrees)
    hand = robot.part("katana_hand").slice
    q[hand] = robot.limits[hand, 0] + CLOSED
    return q
