# SPDX-License-Identifier: Apache-2.0
"""Settings of the service that fetches the cup."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from mobee.behaviours.hand import Hand
from mobee.robot.robot import Robot
from services.common.config import WorldConfig


class Config(WorldConfig, frozen=True, kw_only=True):
    """The settings."""

    target: str = "cup"
    """The upright thing that it fetches, as vision names it."""
    marker: str = "right_palm"
    """The palm that fetches."""
    gains: Literal["default"] = "default"
    """Name of the controller's set of gains."""
    times: Annotated[int, Meta(ge=1)] = 1
    """How often it puts the thing elsewhere, before it ends."""
    fresh: Annotated[float, Meta(ge=0.1, le=5)] = 1.0
    """Time without a new place of the thing after which it pauses, s of simulated time; not while the hand hides it."""

    def check_robot(self, robot: Robot) -> None:
        """Check also that the robot has the hand; raises MobeeError."""
        super().check_robot(robot)
        Hand(robot, self.marker)
