# SPDX-License-Identifier: Apache-2.0
"""Settings of the locator."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from mobee.robot.robot import Robot
from mobee.vision.calibration.calibration import load_calibration
from services.common.cameras import STEREO, CameraConfig, require_cameras


class Config(CameraConfig, frozen=True, kw_only=True):
    """The target locator's settings; it uses the first two cameras."""

    radius: Annotated[float, Meta(gt=0, le=0.5)] = 0.03
    """The ball's radius, in m."""
    calibration: str = ""
    """File of `mobee calibrate`; empty: cameras and encoders are as the model has them."""
    encoder_noise: Annotated[float, Meta(ge=0, le=0.1)] = 0.0025
    """Standard deviation of one reading of an encoder, in rad; with a calibration the covariance of a position depends on it."""
    valid_for: Annotated[float, Meta(gt=0, le=60)] = 5.0
    """Time for which a position may be used after the picture was taken, in s of simulated time."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the robot has two cameras; raises MobeeError."""
        super().check_robot(robot)
        require_cameras(robot, self.cameras_on(robot), STEREO)
        if self.calibration:
            load_calibration(self.calibration).rig(robot, self.cameras_on(robot))
