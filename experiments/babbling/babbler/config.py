"""What the babbler is told."""

from __future__ import annotations

from typing import Annotated, Literal

from msgspec import Meta

from services.common.config import ServiceConfig


class Config(ServiceConfig, frozen=True, kw_only=True):
    """The babbler's settings; its seed is that of the postures."""

    at: Literal["drives", "goals"] = "drives"
    """Whom it commands: the drives of the robot, or the goals of the controller."""
    ticks: Annotated[int, Meta(gt=0)] = 15_000
    """It ends after so many."""
    speed: Annotated[float, Meta(gt=0, le=1)] = 0.2
    """Share of the motors' top speed that its own moves use; the controller has its own."""
    run_dir: str = ""
    """Folder in which commands.jsonl is written."""
