# SPDX-License-Identifier: Apache-2.0
"""The cameras of a scenario: renderer, locator (services/vision) and monitor make the same cameras from the same settings."""

from __future__ import annotations

import numpy as np

from mobee.arrays import Array
from mobee.errors import InvalidValue
from mobee.model.kinematics import link_transforms
from mobee.robot.cameras import EYES, camera_frame, cameras_of
from mobee.robot.robot import Camera, Robot
from services.common.config import ServiceConfig

STEREO = 2  # cameras that locate a ball


class CameraConfig(ServiceConfig, frozen=True, kw_only=True):
    """Settings of a service that makes, reads or shows pictures of cameras."""

    cameras: tuple[str, ...] = ()
    """Further cameras, beside the first two of the robot's file (without cameras in the file: the eyes at its markers left_eye and
    right_eye). Each is the name of another camera in the file, or a new camera: NAME, NAME=x,y,z or NAME=x,y,z,dx,dy,dz with the name of a
    link or marker, a position in m and a direction of view in its frame."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if a camera cannot be made, or if the name of a part cannot be used in keys of the bus."""
        super().check_robot(robot)
        self.cameras_on(robot)

    def cameras_on(self, robot: Robot) -> dict[str, Camera]:
        """Return the first two cameras of the robot and those that the settings add, by name.

        Raises MobeeError for a camera that cannot be made.
        """
        return cameras_of(robot, self.cameras)


def require_cameras(robot: Robot, cameras: dict[str, Camera], count: int) -> None:
    """Raise InvalidValue if the robot has fewer than `count` cameras; the message explains how to add one.

    `cameras`: the robot's cameras by name.
    """
    if len(cameras) >= count:
        return
    has = f"it has {', '.join(cameras) or 'none'}"
    missing = [marker for marker in EYES.values() if marker not in robot.markers]
    raise InvalidValue(
        f"{robot.name!r} cannot see: {count} camera{'s are' if count > 1 else ' is'} needed, and {has}. Put a camera on a link "
        f'(cameras = ["LINK"], or --camera LINK), add {" and ".join(missing) or "cameras"} to the robot\'s file, or leave the service out.'
    )


def frame_at_capture(robot: Robot, camera: Camera, q: Array) -> tuple[Array, Array]:
    """Return the optical centre (3,) m and the rotation (3, 3) of a camera, root frame, at the posture q (n,) rad of a picture.

    The columns of the rotation are the directions to the right and down in the picture, and the direction of view. Raises InvalidValue if q
    does not have one number for each motor.
    """
    if np.shape(q) != (len(robot.motors),):
        raise InvalidValue(f"posture: {np.size(q)} numbers, expected {len(robot.motors)}")
    return camera_frame(camera, link_transforms(robot, q))
