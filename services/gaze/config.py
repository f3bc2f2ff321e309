# SPDX-License-Identifier: Apache-2.0
"""Settings of the gaze, the service that points the cameras at a target."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from mobee.behaviours.gaze import LAG, Gaze
from mobee.control.gains import Gains
from mobee.robot.cameras import cameras_of
from mobee.robot.robot import Robot
from services.common.behaviour import BehaviourConfig
from services.common.cameras import require_cameras


class Config(BehaviourConfig, frozen=True, kw_only=True):
    """The settings of the gaze, which turns the cameras so that a target is in the middle of the pictures."""

    part: str = "head"
    """Part that turns the cameras."""
    cameras: tuple[str, ...] = ()
    """Further cameras to aim, beside those of the robot's file; each as in `services.common.cameras.CameraConfig.cameras`, for example
    NAME, the name of a camera in the file, a link or a marker."""
    lag: Annotated[float, Meta(ge=0, le=0.5)] = LAG
    """Time by which the motors' velocity lags behind the commanded velocity, in s."""

    def check_robot(self, robot: Robot) -> None:
        """Raise MobeeError if there is no camera, if `part` turns none of the cameras, or if a part's name cannot be used on the bus."""
        super().check_robot(robot)
        self.gaze(robot)

    def gaze(self, robot: Robot) -> Gaze:
        """Return a new `Gaze` (it computes the motion of the part) with these settings; raises MobeeError if the part turns no camera."""
        cameras = cameras_of(robot, self.cameras)
        require_cameras(robot, cameras, 1)
        return Gaze(robot, cameras, self.part, self.margin(robot), self.lag, Gains.named(self.gains).weight(robot.motors) > 0)
