# SPDX-License-Identifier: Apache-2.0
"""Camera poses of the robot's eyes, for the renderer and the locator."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.robot.robot import Robot

EYES = ("left_eye", "right_eye")
SEEN_WITH = ("head", "torso")  # parts whose posture is sent with each picture
UPRIGHT = 1e-3  # sine of the smallest angle between a direction of view and the vertical
UP = np.array([0.0, 0.0, 1.0])  # at zero pose the pictures stand upright


def require_eyes(robot: Robot) -> None:
    """Raise InvalidValue if the robot has no usable eyes; the message names the missing elements and the remedy."""
    instead = "Leave renderer and vision out of the scenario, or add what is missing to the robot's file."
    if missing := [name for name in EYES if name not in robot.markers]:
        raise InvalidValue(
            f"{robot.name!r} cannot see: pictures are taken from the markers {' and '.join(EYES)}, and it has no "
            f"{' and no '.join(missing)}. {instead}"
        )
    if missing := [name for name in SEEN_WITH if name not in robot.parts]:
        raise InvalidValue(
            f"{robot.name!r} cannot see: each picture is sent with the posture of its parts {' and '.join(SEEN_WITH)}, and it has no "
            f"part {' and no part '.join(missing)}. {instead}"
        )
    for name in EYES:
        if np.linalg.norm(np.cross(robot.marker(name).normal, UP)) < UPRIGHT:
            raise InvalidValue(
                f"{robot.name!r} cannot see: the normal of its marker {name} is the direction of view, and it is vertical at zero pose, "
                f"so no side of the picture is up. Give the marker a normal that looks ahead (nx, ny, nz)."
            )


def eye_frame(robot: Robot, transforms: Array, eye: str) -> tuple[Array, Array]:
    """Return optical centre (3,) m and rotation (3, 3) of the eye "left" or "right", root frame.

    The columns of the rotation are the picture's right, its down, and the direction of view (the marker's normal).
    `transforms`: (L, 4, 4), see `mobee.model.kinematics.link_transforms`.
    """
    marker = robot.marker(f"{eye}_eye")
    right = np.cross(marker.normal, UP)
    right /= np.linalg.norm(right)
    zero = np.stack([right, np.cross(marker.normal, right), marker.normal], axis=1)
    link = transforms[marker.link]
    return link[:3, :3] @ marker.position + link[:3, 3], link[:3, :3] @ zero


def frame_at_capture(robot: Robot, eye: str, q_head: Array, q_torso: Array) -> tuple[Array, Array]:
    """Return the frame of an eye, see eye_frame, from the postures [rad] of head and torso that were sent with a picture."""
    q = robot.home.copy()
    for name, posture in (("head", q_head), ("torso", q_torso)):
        part = robot.part(name)
        if len(posture) != len(part):
            raise InvalidValue(f"posture of {name}: {len(posture)} numbers, expected {len(part)}")
        q[part.slice] = posture
    return eye_frame(robot, link_transforms(robot, q), eye)
