"""Where the robot's eyes are and what they look at: shared by what draws their pictures and what reads them."""

from __future__ import annotations

import numpy as np

from mobee.errors import InvalidValue
from mobee.kinematics import link_transforms
from mobee.robot.robot import Array, Robot

UP = np.array([0.0, 0.0, 1.0])  # at zero pose the pictures stand upright


def eye_frame(robot: Robot, transforms: Array, eye: str) -> tuple[Array, Array]:
    """Optical centre (3,) m and rotation (3, 3) of the eye "left" or "right", root frame.

    The columns of the rotation are the picture's right, its down, and the direction of view (the marker's normal).
    `transforms`: (L, 4, 4), from link_transforms.
    """
    marker = robot.marker(f"{eye}_eye")
    right = np.cross(marker.normal, UP)
    right /= np.linalg.norm(right)
    zero = np.stack([right, np.cross(marker.normal, right), marker.normal], axis=1)
    link = transforms[marker.link]
    return link[:3, :3] @ marker.position + link[:3, 3], link[:3, :3] @ zero


def frame_at_capture(robot: Robot, eye: str, q_head: Array, q_torso: Array) -> tuple[Array, Array]:
    """The eye's frame, as eye_frame gives it, from the postures that came with a picture, in [rad]."""
    q = robot.home.copy()
    for name, posture in (("head", q_head), ("torso", q_torso)):
        part = robot.part(name)
        if len(posture) != len(part):
            raise InvalidValue(f"posture of {name}: {len(posture)} numbers, expected {len(part)}")
        q[part.slice] = posture
    return eye_frame(robot, link_transforms(robot, q), eye)
