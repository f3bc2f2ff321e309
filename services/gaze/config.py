# SPDX-License-Identifier: Apache-2.0
"""Settings of the gaze."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from mobee.behaviours.gaze import LAG, Gaze
from mobee.control.gains import Gains
from mobee.robot.motor_units import limit_zones
from mobee.robot.robot import Robot
from services.common.cameras import CameraConfig, require_cameras


class Config(CameraConfig, frozen=True, kw_only=True):
    """The gaze's settings; it aims all cameras that the part turns."""

    part: str = "head"
    """Part that turns the cameras."""
    target: str = "ball"
    """What to look at: an object that vision finds, or a marker of the robot."""
    gains: Literal["default", "derived", "published_2014"] = "published_2014"
    """Name of the controller's set of gains; motors that it never moves are left out."""
    rate: Annotated[float, Meta(ge=20, le=200)] = 50.0
    """Times per second at which the goal of the part moves on."""
    lag: Annotated[float, Meta(ge=0, le=0.5)] = LAG
    """Time by which the motors' velocity is later than the commanded one, in s."""
    patience: Annotated[float, Meta(ge=0.1, le=5)] = 0.6
    """Time without a new place of the target after which the part stops and holds, in s of simulated time."""
    release_after: Annotated[float, Meta(ge=0.1, le=3600)] = 10.0
    """Time without a target after which the part is released, in s of simulated time."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the part turns a camera; raises MobeeError."""
        super().check_robot(robot)
        require_cameras(robot, self.cameras_on(robot), 1)
        self.gaze(robot)

    def gaze(self, robot: Robot) -> Gaze:
        """Return a gaze at rest; raises MobeeError."""
        gains = Gains.named(self.gains)
        margin = limit_zones(robot, gains.of_robot("limit_width", robot)).max(axis=1)
        return Gaze(robot, self.cameras_on(robot), self.part, margin, self.lag, gains.weight(robot.motors) > 0)
