# SPDX-License-Identifier: Apache-2.0
"""Settings of the babbler."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import ServiceConfig
from services.common.session import NAMESPACE


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The babbler's settings; `seed` decides the postures."""

    at: Literal["drives", "goals"] = "drives"
    """Target of the commands: the drives of the robot, or the goals of the controller."""
    robot_of: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = NAMESPACE
    """Namespace of the commanded robot: that of the robot, or of a filter in front of it."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.2
    """Share of the motors' top speed for moves at the drives; the controller has its own setting."""
    run_dir: str = ""
    """Folder of commands.jsonl."""
