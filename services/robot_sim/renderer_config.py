"""What the renderer is told."""

from __future__ import annotations

from typing import Annotated

from msgspec import Meta

from services.common.config import ServiceConfig


class RendererConfig(ServiceConfig, frozen=True, kw_only=True):
    """The renderer's settings."""

    world: str = "table"
    """Shipped world, or path to a world file."""
    frame_rate: Annotated[float, Meta(gt=0, le=30)] = 5.0
    """Pictures of each eye a second of simulated time."""
    width: Annotated[int, Meta(ge=16, le=1280)] = 320
    """Columns of a picture."""
    height: Annotated[int, Meta(ge=16, le=1024)] = 240
    """Rows of a picture."""
    view_deg: Annotated[float, Meta(gt=5, lt=120)] = 50.0
    """Vertical field of view, in degrees."""
