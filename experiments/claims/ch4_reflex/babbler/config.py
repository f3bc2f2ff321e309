# SPDX-License-Identifier: Apache-2.0
"""Settings of the babbler, the client of `babbling` that sends random commands."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import ServiceConfig
from services.common.session import NAMESPACE


class Config(ServiceConfig, frozen=True, kw_only=True):
    """Settings of the babbler; its `seed` determines the sequence of random postures."""

    at: Literal["drives", "goals"] = "drives"
    """What is commanded: "drives", the motors of the robot, or "goals", the attractors of the controller."""
    robot_of: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = NAMESPACE
    """Namespace of the commanded robot: that of the robot itself, or of a filter in front of it."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.2
    """Share of the motors' maximum speed for moves at the drives, in (0, 1]; for goals the controller's own setting counts."""
    run_dir: str = ""
    """Folder in which the client writes its commands, as commands.jsonl."""
