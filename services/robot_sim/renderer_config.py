"""Settings of the renderer."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from mobee.robot.robot import Robot
from services.common.config import WorldConfig
from services.common.eyes import require_eyes


class RendererConfig(WorldConfig, frozen=True, kw_only=True):
    """The renderer's settings."""

    frame_rate: Annotated[float, Meta(gt=0, le=30)] = 5.0
    """Pictures of each eye a second of simulated time."""
    width: Annotated[int, Meta(ge=16, le=1280)] = 320
    """Columns of a picture."""
    height: Annotated[int, Meta(ge=16, le=1024)] = 240
    """Rows of a picture."""
    view_deg: Annotated[float, Meta(gt=5, lt=120)] = 50.0
    """Vertical field of view, in degrees."""

    def check_robot(self, robot: Robot) -> None:
        """As ServiceConfig: a robot needs eyes."""
        super().check_robot(robot)
        require_eyes(robot)
