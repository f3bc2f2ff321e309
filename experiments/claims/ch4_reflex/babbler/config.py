"""Settings of the babbler."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import ServiceConfig
from services.common.session import NAMESPACE


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The babbler's settings; its seed is that of the postures."""

    at: Literal["drives", "goals"] = "drives"
    """What it commands: the drives of the robot, or the goals of the controller."""
    robot_of: Annotated[str, Meta(pattern="^[a-z0-9_]+$")] = NAMESPACE
    """Namespace of the robot that it commands: the robot's own, or that of a filter in front of it."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.2
    """Share of the motors' top speed that its own moves use; the controller has its own."""
    run_dir: str = ""
    """Folder in which commands.jsonl is written."""
